//! The built-in materials.

use nalgebra::Vector3;

use crate::base::error::{Error, Result};
use crate::brdf::analytic::{
    AnalyticBrdf, AshikhminShirley, Blinn, BlinnPhong, CookTorrance, Lambert, Phong, Sgd, Ward,
};
use crate::brdf::{Brdf, Rgb};

/// A material that needs no file.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BuiltInMaterial {
    /// The name by which [`material`] finds it, lower case with hyphens.
    pub name: &'static str,
    /// The name to show.
    pub title: &'static str,
    /// What it is and where it comes from, in a few words.
    pub description: &'static str,
    /// Citation of the model or of the fit.
    pub source: &'static str,
    /// Its reflectance; isotropic.
    pub brdf: AnalyticBrdf,
}

impl Brdf for BuiltInMaterial {
    fn eval(&self, wi: &Vector3<f64>, wo: &Vector3<f64>) -> Rgb {
        self.brdf.eval(wi, wo)
    }
}

/// All built-in materials: seven reconstructions from published fits, then one material for each other
/// analytic model.
#[must_use]
pub fn materials() -> &'static [BuiltInMaterial] {
    &MATERIALS
}

/// The built-in material called `name`.
///
/// # Errors
/// [`Error::UnknownName`], which lists the names that exist.
pub fn material(name: &str) -> Result<&'static BuiltInMaterial> {
    MATERIALS.iter().find(|m| m.name == name).ok_or_else(|| Error::UnknownName {
        kind: "built-in material",
        name: name.to_owned(),
        known: MATERIALS.iter().map(|m| m.name).collect::<Vec<_>>().join(", "),
    })
}

const SGD_FITS: &str = "M. M. Bagher, C. Soler, N. Holzschuch, \"Accurate Fitting of Measured Reflectances Using \
                        a Shifted Gamma Micro-facet Distribution\", 2012: published parameters";

static MATERIALS: [BuiltInMaterial; 14] = [
    BuiltInMaterial {
        name: "cherry-235",
        title: "Cherry 235",
        description: "glossy varnished cherry wood: reconstruction from the published SGD fit",
        source: SGD_FITS,
        brdf: AnalyticBrdf::Sgd(CHERRY_235),
    },
    BuiltInMaterial {
        name: "red-plastic",
        title: "Red plastic",
        description: "red plastic: reconstruction from the published SGD fit",
        source: SGD_FITS,
        brdf: AnalyticBrdf::Sgd(RED_PLASTIC),
    },
    BuiltInMaterial {
        name: "purple-paint",
        title: "Purple paint",
        description: "glossy purple paint: reconstruction from the published SGD fit",
        source: SGD_FITS,
        brdf: AnalyticBrdf::Sgd(PURPLE_PAINT),
    },
    BuiltInMaterial {
        name: "blue-rubber",
        title: "Blue rubber",
        description: "dull blue rubber: reconstruction from the published SGD fit",
        source: SGD_FITS,
        brdf: AnalyticBrdf::Sgd(BLUE_RUBBER),
    },
    BuiltInMaterial {
        name: "blue-metallic-paint",
        title: "Blue metallic paint",
        description: "blue metallic paint: reconstruction from the published SGD fit",
        source: SGD_FITS,
        brdf: AnalyticBrdf::Sgd(BLUE_METALLIC_PAINT),
    },
    BuiltInMaterial {
        name: "silver-paint",
        title: "Silver paint",
        description: "silver paint: reconstruction from the published SGD fit",
        source: SGD_FITS,
        brdf: AnalyticBrdf::Sgd(SILVER_PAINT),
    },
    BuiltInMaterial {
        name: "violet-rubber",
        title: "Violet rubber",
        description: "violet rubber: reconstruction from the published SGD fit",
        source: SGD_FITS,
        brdf: AnalyticBrdf::Sgd(VIOLET_RUBBER),
    },
    BuiltInMaterial {
        name: "lambert",
        title: "Plaster (Lambert)",
        description: "warm white plaster: analytic model, parameters chosen here",
        source: "J. H. Lambert, \"Photometria\", 1760",
        brdf: AnalyticBrdf::Lambert(Lambert { albedo: [0.80, 0.75, 0.68] }),
    },
    BuiltInMaterial {
        name: "phong",
        title: "Orange plastic (Phong)",
        description: "orange plastic: analytic model, parameters chosen here",
        source: "E. P. Lafortune, Y. D. Willems, \"Using the Modified Phong Reflectance Model for Physically \
                 Based Rendering\", 1994",
        brdf: AnalyticBrdf::Phong(Phong {
            diffuse: [0.60, 0.20, 0.03],
            specular: [0.15, 0.15, 0.15],
            exponent: 60.0,
        }),
    },
    BuiltInMaterial {
        name: "blinn-phong",
        title: "Teal enamel (Blinn-Phong)",
        description: "teal enamel: analytic model, parameters chosen here",
        source: "J. F. Blinn, \"Models of Light Reflection for Computer Synthesized Pictures\", 1977",
        brdf: AnalyticBrdf::BlinnPhong(BlinnPhong {
            diffuse: [0.03, 0.27, 0.30],
            specular: [0.12, 0.12, 0.12],
            exponent: 400.0,
        }),
    },
    BuiltInMaterial {
        name: "ward",
        title: "Satin varnish (Ward)",
        description: "wood under satin varnish: analytic model, parameters chosen here",
        source: "G. J. Ward, \"Measuring and Modeling Anisotropic Reflection\", 1992",
        brdf: AnalyticBrdf::Ward(Ward {
            diffuse: [0.28, 0.15, 0.08],
            specular: [0.06, 0.06, 0.06],
            alpha_x: 0.14,
            alpha_y: 0.14,
        }),
    },
    BuiltInMaterial {
        name: "ashikhmin-shirley",
        title: "Green lacquer (Ashikhmin-Shirley)",
        description: "green lacquer, equal exponents: analytic model, parameters chosen here",
        source: "M. Ashikhmin, P. Shirley, \"An Anisotropic Phong BRDF Model\", 2000",
        brdf: AnalyticBrdf::AshikhminShirley(AshikhminShirley {
            diffuse: [0.06, 0.35, 0.12],
            specular: [0.05, 0.05, 0.05],
            exponent_u: 150.0,
            exponent_v: 150.0,
        }),
    },
    BuiltInMaterial {
        name: "blinn",
        title: "Glazed ceramic (Blinn)",
        description: "pale blue glazed ceramic: analytic model, parameters chosen here",
        source: "J. F. Blinn, \"Models of Light Reflection for Computer Synthesized Pictures\", 1977",
        brdf: AnalyticBrdf::Blinn(Blinn {
            diffuse: [0.25, 0.36, 0.45],
            specular: [0.55, 0.55, 0.55],
            eccentricity: 0.15,
            ior: [1.5, 1.5, 1.5],
        }),
    },
    BuiltInMaterial {
        name: "cook-torrance",
        title: "Rough copper (Cook-Torrance)",
        description: "rough copper: analytic model, parameters chosen here",
        source: "R. L. Cook, K. E. Torrance, \"A Reflectance Model for Computer Graphics\", 1982",
        brdf: AnalyticBrdf::CookTorrance(CookTorrance {
            diffuse: [0.03, 0.015, 0.01],
            specular: [0.95, 0.95, 0.95],
            roughness: 0.3,
            // These indices give a reflectance of 0.955, 0.638, 0.538 at normal incidence.
            ior: [86.9, 8.94, 6.50],
        }),
    },
];

// Parameters published with Bagher et al. (2012), in the order red, green, blue.

const CHERRY_235: Sgd = Sgd {
    diffuse: [0.049_750_2, 0.021_190_2, 0.012_068_8],
    specular: [0.166_001, 0.202_786, 0.165_189],
    alpha: [0.018_260_5, 0.027_799_7, 0.025_572_1],
    p: [0.035_834_8, 0.163_231, 0.129_135],
    f0: [0.071_340_8, 0.057_171_9, 0.079_180_9],
    f1: [0.020_081_4, 0.008_873_06, 0.025_167_5],
    kappa: [54.744_8, 33.729_4, 37.36],
    lambda: [6.113_14, 6.236_97, 6.163_51],
    c: [30.388_6, 0.001_918_69, 0.049_506_9],
    k: [18.811_4, 25.845_4, 23.375_3],
    theta0: [0.816_378, 0.387_479, 0.522_125],
};

const RED_PLASTIC: Sgd = Sgd {
    diffuse: [0.247_569, 0.049_382, 0.017_562_1],
    specular: [0.406_976, 0.151_478, 0.176_348],
    alpha: [0.287_23, 0.057_248_9, 0.062_468_2],
    p: [0.939_617, 0.085_197_3, 0.070_148_3],
    f0: [0.100_36, 0.178_468, 0.149_441],
    f1: [0.051_269_7, 0.131_91, 0.102_958],
    kappa: [3.805_64, 17.837_4, 16.563_1],
    lambda: [4.370_31, 4.960_92, 4.759_24],
    c: [1.038_22e-7, 0.023_684_5, 0.032_154_6],
    k: [18.608_8, 16.137_1, 15.124_3],
    theta0: [-0.609_047, 0.435_47, 0.445_882],
};

const PURPLE_PAINT: Sgd = Sgd {
    diffuse: [0.290_743, 0.034_711_8, 0.033_980_2],
    specular: [0.301_308, 0.205_258, 0.280_717],
    alpha: [0.033_917_3, 0.008_394_25, 0.037_801_1],
    p: [0.703_279, 0.200_83, 0.797_376],
    f0: [0.065_495_8, 0.078_651_2, 0.069_642_4],
    f1: [0.029_949_4, 0.046_765_1, 0.037_364_9],
    kappa: [16.370_5, 104.698, 13.210_1],
    lambda: [1.728_14, 6.776_84, 1.546_79],
    c: [1.105_48e-7, 0.177_314, 6.667_98e-8],
    k: [38.084_7, 41.171_2, 38.278_1],
    theta0: [0.078_973_8, 0.576_929, 0.058_714_4],
};

const BLUE_RUBBER: Sgd = Sgd {
    diffuse: [0.037_130_2, 0.073_291_5, 0.146_637],
    specular: [0.384_232, 0.412_357, 0.612_608],
    alpha: [0.218_197, 0.266_8, 0.478_375],
    p: [0.815_054, 1.001_46, 1.249_95],
    f0: [0.063_171_3, 0.062_263_6, 0.039_919_6],
    f1: [0.047_825_4, 0.042_218_6, 0.007_015],
    kappa: [4.415_86, 3.767_95, 3.462_76],
    lambda: [3.778_07, 3.826_79, 3.331_86],
    c: [1.294_1e-7, 1.071_94e-7, 0.000_456_65],
    k: [19.804_6, 19.311_5, 11.436_4],
    theta0: [-0.499_472, -0.557_706, -0.172_177],
};

const BLUE_METALLIC_PAINT: Sgd = Sgd {
    diffuse: [0.003_904_46, 0.003_373_19, 0.008_481_98],
    specular: [0.070_677_1, 0.041_508_2, 0.104_423],
    alpha: [0.155_564, 0.139, 0.150_88],
    p: [1.017_19, 1.026_02, 1.161_53],
    f0: [0.149_347, 0.153_181, 1.872_41e-14],
    f1: [-0.487_331, -0.765_57, -1.0],
    kappa: [4.422_2, 4.592_65, 3.939_29],
    lambda: [2.543_45, 2.338_84, 2.244_05],
    c: [6.049_06e-8, 5.818_58e-8, 1.241_9e-7],
    k: [23.953_3, 25.064_1, 24.685_6],
    theta0: [-0.340_53, -0.294_595, -0.258_117],
};

const SILVER_PAINT: Sgd = Sgd {
    diffuse: [0.152_796, 0.124_616, 0.113_375],
    specular: [0.304_18, 0.301_46, 0.283_174],
    alpha: [0.110_819, 0.105_318, 0.078_567_7],
    p: [0.640_378, 0.641_115, 0.445_228],
    f0: [2.373_47e-13, 7.681_94e-13, 2.943_4e-12],
    f1: [-0.350_607, -0.355_433, -0.359_297],
    kappa: [7.215_31, 7.465_19, 10.828_9],
    lambda: [3.060_16, 2.976_52, 3.782_87],
    c: [9.716_66e-8, 1.093_42e-7, 9.823_36e-8],
    k: [24.147_5, 24.508_3, 25.675_7],
    theta0: [-0.281_384, -0.257_633, -0.200_968],
};

const VIOLET_RUBBER: Sgd = Sgd {
    diffuse: [0.223_179, 0.055_363_4, 0.113_238],
    specular: [0.547_456, 0.096_602_7, 0.185_463],
    alpha: [0.445_092, 0.089_421, 0.154_3],
    p: [0.923_481, 0.782_897, 0.800_907],
    f0: [0.051_892_7, 0.113_508, 0.094_549],
    f1: [-0.020_895_5, 0.058_506_3, 0.036_751],
    kappa: [3.586_73, 7.335_39, 5.244_04],
    lambda: [2.830_07, 2.277_88, 3.000_09],
    c: [0.003_742_66, 9.656_28e-8, 1.137_46e-7],
    k: [9.675_34, 27.189_8, 22.351_9],
    theta0: [-0.003_793_6, -0.174_481, -0.363_226],
};

#[cfg(test)]
mod tests {
    use super::*;
    use crate::brdf::analytic::checks::{
        albedo, assert_conserves_energy, assert_pinned, assert_well_behaved,
    };

    #[test]
    fn every_material_is_isotropic_reciprocal_finite_and_no_source_of_light() {
        for m in materials() {
            assert_well_behaved(m, m.name);
            match m.brdf {
                // These are fits to measurements: nothing in the model bounds their albedo at grazing
                // incidence.
                AnalyticBrdf::Sgd(_) => {
                    let found = albedo(m, 0.5, 512);
                    assert!(found.iter().all(|x| *x > 0.005 && *x < 0.7), "{} {found:?}", m.name);
                }
                _ => assert_conserves_energy(m, m.name),
            }
        }
    }

    #[test]
    fn names_are_unique_and_found() {
        let expected = "cherry-235, red-plastic, purple-paint, blue-rubber, blue-metallic-paint, silver-paint, \
                        violet-rubber, lambert, phong, blinn-phong, ward, ashikhmin-shirley, blinn, cook-torrance";
        let error = material("Cherry-235").unwrap_err();
        assert_eq!(
            error.to_string(),
            format!("no built-in material is called \"Cherry-235\": expected one of {expected}")
        );
        for (k, m) in materials().iter().enumerate() {
            assert_eq!(material(m.name).unwrap(), m);
            assert_eq!(expected.split(", ").nth(k), Some(m.name));
            match m.brdf {
                AnalyticBrdf::Sgd(_) => {
                    assert!(m.description.contains("reconstruction from the published SGD fit"))
                }
                other => assert_eq!(other.model_name(), m.name),
            }
        }
    }

    #[test]
    fn published_fits_at_pinned_directions() {
        assert_pinned(
            material("cherry-235").unwrap(),
            [
                [0.019_997_795_292_453_796, 0.014_172_500_258_863_683, 0.010_567_039_105_403_478],
                [0.090_465_600_661_731_84, 0.124_832_474_849_788_03, 0.106_615_776_309_597_54],
                [0.015_835_980_499_620_823, 0.006_745_050_150_211_761, 0.003_841_618_354_374_933],
                [0.116_504_855_724_290_16, 0.111_945_996_565_200_99, 0.104_808_618_092_584_36],
            ],
        );
        assert_pinned(
            material("purple-paint").unwrap(),
            [
                [0.097_478_950_420_492_94, 0.011_195_605_497_039_856, 0.015_138_367_889_366_535],
                [0.190_523_457_572_122_6, 0.017_574_060_198_081_637, 0.100_172_895_115_987_15],
                [0.092_546_371_238_733_85, 0.011_049_109_107_234_506, 0.010_816_233_594_502_444],
                [0.476_806_438_309_804_46, 0.428_812_130_443_866_7, 0.360_802_910_795_785_2],
            ],
        );
        assert_pinned(
            material("blue-metallic-paint").unwrap(),
            [
                [0.038_202_715_355_730_35, 0.030_910_573_559_714_147, 0.080_739_907_108_631_7],
                [0.140_613_235_747_486_35, 0.103_941_127_456_028_22, 0.237_132_692_873_805_7],
                [0.001_245_576_585_113_342_5, 0.001_074_446_054_114_748_2, 0.002_702_909_628_885_061],
                [0.161_659_089_188_934_76, 0.161_648_088_990_584_17, 0.423_984_044_582_839_5],
            ],
        );
    }

    #[cfg(feature = "formats")]
    #[test]
    fn published_fits_equal_the_table_of_parameters() {
        let Some(folder) = crate::test_data::data_dir() else { return };
        let mut reader = csv::ReaderBuilder::new()
            // Some rows lack the alias, but none of these seven does.
            .flexible(true)
            .from_path(folder.join("merl_fits/sgd_params.csv"))
            .unwrap();
        let headers = reader.headers().unwrap().clone();
        let mut found = 0;
        for row in reader.records() {
            let row = row.unwrap();
            let Some(m) = materials().iter().find(|m| m.name == &row[0]) else { continue };
            assert_eq!(row.len(), headers.len(), "{}", m.name);
            let AnalyticBrdf::Sgd(f) = m.brdf else { panic!("{} is not a fit", m.name) };
            let parameters = [
                ("rho_d", f.diffuse),
                ("rho_s", f.specular),
                ("alpha", f.alpha),
                ("p", f.p),
                ("f0", f.f0),
                ("f1", f.f1),
                ("kappa", f.kappa),
                ("lambda", f.lambda),
                ("c", f.c),
                ("k", f.k),
                ("theta0", f.theta0),
            ];
            for (name, values) in parameters {
                for (channel, value) in ["r", "g", "b"].iter().zip(values) {
                    let column = format!("{name}_{channel}");
                    let at = headers.iter().position(|h| h == column).unwrap();
                    assert_eq!(row[at].parse::<f64>().unwrap(), value, "{} {column}", m.name);
                }
            }
            found += 1;
        }
        assert_eq!(found, 7);
    }
}

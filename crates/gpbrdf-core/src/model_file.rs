//! Models on disk: safetensors with everything that is not a tensor as JSON in its metadata.
//!
//! Tensors are f64 but for inducing values. A lattice process `g` has `g.u`, `g.v`, `g.phi` (kernel coordinates of the nodes),
//! `g.targets` and `g.weights` (`channels x A x B x C`); a dense one `g.x` (`n x 3`), `g.targets` and `g.weights`
//! (`n x channels`). Component `k` of an inducing process has `k.values` (`A x B x C`), in f16, from which nodes and
//! weights follow. The metadata entry `gpbrdf` holds the rest, with numbers that read back to the same bits;
//! `version` is the format's version.

use std::collections::{BTreeMap, HashMap};
use std::path::Path;

use safetensors::tensor::{Dtype, SafeTensors, TensorView};
use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};
use crate::gp::{
    DenseGp, InducingComponent, InducingGp, InducingShape, LatticeData, LatticeGp, LatticeHyper,
};
use crate::half::to_half;
use crate::kernel::Kernel;
use crate::model::{Model, Process, Provenance, check_channels};
use crate::space::InputSpace;
use crate::target::{MeanFunction, Transform};

/// The version of the format that is written, and the only one that is read.
const VERSION: u32 = 1;

/// Everything of a model that is not a tensor.
#[derive(Serialize, Deserialize)]
struct Header {
    version: u32,
    written_by: String,
    provenance: Provenance,
    transform: Transform,
    mean: MeanFunction,
    offsets: [f64; 3],
    space: InputSpace,
    process: ProcessHeader,
}

#[derive(Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
enum ProcessHeader {
    Lattice(Vec<LatticeHyper>),
    Dense(Vec<DenseHeader>),
    Inducing(InducingHeader),
}

#[derive(Serialize, Deserialize)]
struct InducingHeader {
    mix: [[f64; 3]; 3],
    cells: usize,
    components: Vec<InducingShape>,
}

#[derive(Serialize, Deserialize)]
struct DenseHeader {
    kernel: Kernel,
    noise_variance: f64,
    channels: usize,
}

impl Model {
    /// The bytes of a model file.
    ///
    /// # Errors
    /// Numbers that JSON cannot hold.
    pub fn to_bytes(&self) -> Result<Vec<u8>> {
        let mut tensors: BTreeMap<String, (Dtype, Vec<usize>, Vec<u8>)> = BTreeMap::new();
        let mut insert = |name: String, shape: Vec<usize>, values: &[f64]| {
            let bytes = values.iter().flat_map(|x| x.to_le_bytes()).collect();
            tensors.insert(name, (Dtype::F64, shape, bytes));
        };
        let process = match &self.process {
            Process::Lattice(groups) => {
                for (g, gp) in groups.iter().enumerate() {
                    let data = gp.data();
                    for (axis, x) in AXES.iter().zip(&data.coordinates) {
                        insert(format!("{g}.{axis}"), vec![x.len()], x);
                    }
                    let [a, b, c] = data.shape();
                    insert(format!("{g}.targets"), vec![data.channels, a, b, c], &data.targets);
                    insert(format!("{g}.weights"), vec![data.channels, a, b, c], gp.weights());
                }
                ProcessHeader::Lattice(groups.iter().map(|gp| gp.hyper().clone()).collect())
            }
            Process::Dense(groups) => {
                let mut headers = Vec::with_capacity(groups.len());
                for (g, gp) in groups.iter().enumerate() {
                    let (n, channels) = (gp.n_samples(), gp.channels());
                    insert(format!("{g}.x"), vec![n, 3], gp.inputs());
                    insert(format!("{g}.targets"), vec![n, channels], &gp.targets());
                    insert(format!("{g}.weights"), vec![n, channels], &gp.weights());
                    let (kernel, noise_variance) = (gp.kernel().clone(), gp.noise_variance());
                    headers.push(DenseHeader { kernel, noise_variance, channels });
                }
                ProcessHeader::Dense(headers)
            }
            Process::Inducing(gp) => {
                for (k, component) in gp.components.iter().enumerate() {
                    let bytes = component.values().iter().flat_map(|&x| to_half(x).to_le_bytes()).collect();
                    let shape = component.lattice().shape.to_vec();
                    tensors.insert(format!("{k}.values"), (Dtype::F16, shape, bytes));
                }
                let components = gp.components.iter().map(|c| c.lattice().clone()).collect();
                ProcessHeader::Inducing(InducingHeader { mix: gp.mix, cells: gp.cells, components })
            }
        };
        let header = Header {
            version: VERSION,
            written_by: concat!("gpbrdf ", env!("CARGO_PKG_VERSION")).into(),
            provenance: self.provenance.clone(),
            transform: self.transform,
            mean: self.mean,
            offsets: self.offsets,
            space: self.space,
            process,
        };
        let unwritable = |what: &dyn std::fmt::Display| Error::argument("model", "finite numbers", what);
        let json = serde_json::to_string(&header).map_err(|e| unwritable(&e))?;
        let views = tensors
            .iter()
            .map(|(name, (dtype, shape, bytes))| Ok((name, TensorView::new(*dtype, shape.clone(), bytes)?)))
            .collect::<Result<Vec<_>, safetensors::SafeTensorError>>()
            .map_err(|e| unwritable(&e))?;
        safetensors::serialize(views, Some(HashMap::from([("gpbrdf".to_owned(), json)])))
            .map_err(|e| unwritable(&e))
    }

    /// Reads a model file. Predictions of the result equal those of the model that was written, bit for bit.
    ///
    /// # Errors
    /// A file that cannot be read, is not a model of this version, or is damaged.
    pub fn load(path: &Path) -> Result<Self> {
        let bytes = std::fs::read(path).map_err(|e| Error::read(path, e))?;
        Self::from_bytes(&bytes, path)
    }

    /// Reads a model from the bytes of a file; `path` is for messages.
    ///
    /// # Errors
    /// Bytes that are not a model of this version, or are damaged.
    pub fn from_bytes(bytes: &[u8], path: &Path) -> Result<Self> {
        let wrong = |expected: &str, found: String| Error::Format {
            format: "model",
            path: path.to_owned(),
            expected: expected.to_owned(),
            found,
        };
        let parsed = |e: safetensors::SafeTensorError| wrong("a safetensors file", e.to_string());
        let (_, metadata) = SafeTensors::read_metadata(bytes).map_err(parsed)?;
        let tensors = SafeTensors::deserialize(bytes).map_err(parsed)?;
        let json = metadata
            .metadata()
            .as_ref()
            .and_then(|m| m.get("gpbrdf"))
            .ok_or_else(|| wrong("the metadata entry \"gpbrdf\"", "none".into()))?;
        let version: VersionOnly =
            serde_json::from_str(json).map_err(|e| wrong("a version number", e.to_string()))?;
        if version.version != VERSION {
            return Err(wrong(&format!("version {VERSION}"), format!("version {}", version.version)));
        }
        let header: Header =
            serde_json::from_str(json).map_err(|e| wrong("metadata of a model", e.to_string()))?;
        let read = |name: String| -> Result<Vec<f64>> {
            let tensor =
                tensors.tensor(&name).map_err(|e| wrong(&format!("a tensor \"{name}\""), e.to_string()))?;
            let values: Vec<f64> = match tensor.dtype() {
                Dtype::F64 => {
                    let (chunks, _) = tensor.data().as_chunks::<8>();
                    chunks.iter().map(|b| f64::from_le_bytes(*b)).collect()
                }
                Dtype::F16 => {
                    let (chunks, _) = tensor.data().as_chunks::<2>();
                    chunks.iter().map(|b| ::half::f16::from_le_bytes(*b).to_f64()).collect()
                }
                other => {
                    return Err(wrong(&format!("f64 or f16 in tensor \"{name}\""), format!("{other:?}")));
                }
            };
            match values.iter().position(|x| !x.is_finite()) {
                None => Ok(values),
                Some(i) => Err(wrong(
                    &format!("finite numbers in tensor \"{name}\""),
                    format!("{} at {i}", values[i]),
                )),
            }
        };
        let damaged = |e: Error| wrong("a consistent model", e.to_string());
        header.transform.validate().map_err(damaged)?;
        header.space.validate().map_err(damaged)?;
        let process = match header.process {
            ProcessHeader::Lattice(hypers) => {
                if !matches!(header.space, InputSpace::WarpedBox { .. }) {
                    return Err(wrong("a lattice in the warped box", format!("{:?}", header.space)));
                }
                let groups = hypers.into_iter().enumerate().map(|(g, hyper)| {
                    let [u, v, phi] = AXES.map(|axis| read(format!("{g}.{axis}")));
                    let targets = read(format!("{g}.targets"))?;
                    let coordinates = [u?, v?, phi?];
                    let nodes: usize = coordinates.iter().map(Vec::len).product();
                    let channels = targets.len() / nodes.max(1);
                    let (metrics, mirrored) = (header.space.lattice_metrics(), header.space.mirrored());
                    let data = LatticeData { coordinates, metrics, mirrored, targets, channels };
                    LatticeGp::from_weights(data, hyper, read(format!("{g}.weights"))?).map_err(damaged)
                });
                Process::Lattice(groups.collect::<Result<_>>()?)
            }
            ProcessHeader::Dense(headers) => {
                let groups = headers.into_iter().enumerate().map(|(g, dense)| {
                    let (x, targets) = (read(format!("{g}.x"))?, read(format!("{g}.targets"))?);
                    let weights = read(format!("{g}.weights"))?;
                    let DenseHeader { kernel, noise_variance, channels } = dense;
                    if kernel.dimension() != 3 {
                        return Err(wrong("a kernel of 3 coordinates", kernel.dimension().to_string()));
                    }
                    DenseGp::from_weights(&x, &targets, &weights, channels, kernel, noise_variance)
                        .map_err(damaged)
                });
                Process::Dense(groups.collect::<Result<_>>()?)
            }
            ProcessHeader::Inducing(InducingHeader { mix, cells, components }) => {
                let components = components.into_iter().enumerate().map(|(k, lattice)| {
                    InducingComponent::new(lattice, read(format!("{k}.values"))?).map_err(damaged)
                });
                let components = components.collect::<Result<_>>()?;
                Process::Inducing(Box::new(InducingGp { mix, components, cells }))
            }
        };
        check_channels(&process).map_err(damaged)?;
        Ok(Self {
            provenance: header.provenance,
            transform: header.transform,
            mean: header.mean,
            offsets: header.offsets,
            space: header.space,
            process,
        })
    }
}

/// Names of the lattice axes in a file.
const AXES: [&str; 3] = ["u", "v", "phi"];

#[derive(Deserialize)]
struct VersionOnly {
    version: u32,
}

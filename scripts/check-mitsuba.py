#!/usr/bin/env python3
"""Compares the RGL files that gpbrdf-cli writes with what Mitsuba 3 makes of them.

    python3 -m venv venv && venv/bin/pip install mitsuba numpy scipy
    venv/bin/python scripts/check-mitsuba.py target/release/gpbrdf-cli [INPUT ...]

Each INPUT is a measurement, a table, a model or a built-in material; without one, these are three built-in materials, a
table and a fitted model. Mitsuba's plugin `measured` has to load both kinds of files, to agree with the source at some
thousand directions, to agree with itself in a picture of a sphere in RGB and in spectra, and to pass Mitsuba's own
chi-square test of samples against their density. Mitsuba needs a recent LLVM library for that: version 15 is too old
for Mitsuba 3.9, whose environment variable DRJIT_LIBLLVM_PATH names another one. The test integrates densities on a
grid, so it may fail for highlights much sharper than a degree. The exit code is 0 only if all of this holds.
"""

import csv
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

try:
    import mitsuba as mi
except ImportError:
    sys.exit("expected the package mitsuba; install it by pip install mitsuba numpy scipy")

# Directions with a smaller cosine are not compared: measurements are extrapolated there.
GRAZING_COSINE = 0.08
# Half of all directions have to agree to this part of their largest channel,
MEDIAN = 0.005
# and the reflected light, averaged over all directions, to this part.
LIGHT = 0.02
# Spectra have to give the colours of the RGB file to this part of the largest channel.
ROUND_TRIP = 1e-3
# The chi-square test of all directions together fails by chance once in a hundred runs.
SIGNIFICANCE = 0.01
# Angles of incidence of that test, degrees.
INCIDENCES = [2, 30, 55, 75]


def run(cli, *arguments):
    """Runs the command line and ends this program with its message if it fails."""
    done = subprocess.run([cli, *map(str, arguments), "-q"], capture_output=True, text=True)
    if done.returncode != 0:
        sys.exit(f"{cli} {' '.join(map(str, arguments))}: {done.stderr.strip()}")


def reference(path):
    """Directions (wi, wo) and values of a CSV file of samples."""
    with open(path, newline="") as file:
        rows = list(csv.DictReader(line for line in file if not line.startswith("#")))
    columns = ["theta_i_deg", "phi_i_deg", "theta_o_deg", "phi_o_deg"]
    angles = np.radians([[float(row[name]) for name in columns] for row in rows])
    values = np.array([[float(row[name]) for name in "rgb"] for row in rows])

    def direction(theta, phi):
        return np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)])

    wi, wo = direction(angles[:, 0], angles[:, 1]), direction(angles[:, 2], angles[:, 3])
    keep = np.minimum(wi[2], wo[2]) > GRAZING_COSINE
    return wi[:, keep], wo[:, keep], values[keep]


def load(path):
    return mi.load_dict({"type": "measured", "filename": str(path)})


def evaluate(bsdf, wi, wo, wavelengths=None):
    """f cos(theta_o) of each direction, one row for each channel."""
    si = mi.SurfaceInteraction3f()
    si.wi = mi.Vector3f(wi)
    si.wavelengths = [] if wavelengths is None else wavelengths
    return np.array(bsdf.eval(mi.BSDFContext(), si, mi.Vector3f(wo)))


def linear_srgb(bsdf, wi, wo):
    """The colours of spectra under D65, by Mitsuba's observer and illuminant."""
    nm = np.arange(360.0, 831.0, 5.0)
    si = mi.SurfaceInteraction3f()
    si.wavelengths = mi.UnpolarizedSpectrum(np.resize(nm, (4, len(nm))))
    power = np.array(mi.load_dict({"type": "d65"}).eval(si))[0]
    observer = np.array(mi.cie1931_xyz(mi.Float(nm))) * power
    to_srgb = np.array([[3.2404542, -1.5371385, -0.4985314],
                        [-0.9692660, 1.8760108, 0.0415560],
                        [0.0556434, -0.2040259, 1.0572252]])
    weights = to_srgb @ (observer / observer[1].sum())
    colours = np.zeros((wi.shape[1], 3))
    least = np.inf
    for wavelength, weight in zip(nm, weights.T):
        value = evaluate(bsdf, wi, wo, [float(wavelength)] * 4)[0]
        least = min(least, value.min())
        colours += value[:, None] * weight
    return colours, least


def sphere(bsdf):
    """The average colour of a sphere in a picture of it under a white sky."""
    scene = mi.load_dict({
        "type": "scene",
        "integrator": {"type": "path", "max_depth": 2},
        "sky": {"type": "constant"},
        "sphere": {"type": "sphere", "bsdf": bsdf},
        "sensor": {
            "type": "perspective",
            "fov": 20,
            "to_world": mi.ScalarTransform4f().look_at([0, 0, 8], [0, 0, 0], [0, 1, 0]),
            "film": {"type": "hdrfilm", "width": 48, "height": 48, "rfilter": {"type": "box"}},
            "sampler": {"type": "independent", "sample_count": 512},
        },
    })
    pixels = np.array(mi.render(scene, seed=1))[12:36, 12:36, :3]
    return pixels.mean(axis=(0, 1)) if np.isfinite(pixels).all() else np.full(3, np.nan)


def chi_square(path):
    """The p-value of Mitsuba's own test at each incidence."""
    from mitsuba.chi2 import BSDFAdapter, ChiSquareTest, SphericalDomain

    values = []
    for incidence in np.radians(INCIDENCES):
        plugin = {"type": "measured", "filename": str(path)}
        sample, pdf = BSDFAdapter("measured", plugin, wi=[float(np.sin(incidence)), 0.0, float(np.cos(incidence))])
        test = ChiSquareTest(
            domain=SphericalDomain(), sample_func=sample, pdf_func=pdf, sample_dim=3, res=201, ires=16,
        )
        # With this significance all tests together are what SIGNIFICANCE says.
        passed = test.run(SIGNIFICANCE, test_count=len(INCIDENCES), quiet=True)
        values.append((passed, test.p_value))
    return values


def check(cli, source, folder):
    """Prints what was found about one source; returns whether it is as it should be."""
    rgb_file, spectral_file, samples = folder / "rgb.bsdf", folder / "spectral.bsdf", folder / "samples.csv"
    run(cli, "convert", source, rgb_file, "--rgb")
    run(cli, "convert", source, spectral_file)
    run(cli, "convert", source, samples, "--samples", 20000)
    wi, wo, truth = reference(samples)
    failures = []

    def expect(name, is_met, text):
        print(f"  {name}: {text}{'' if is_met else '   <-- not as expected'}")
        if not is_met:
            failures.append(name)

    mi.set_variant("llvm_ad_rgb")
    bsdf = load(rgb_file)
    rgb = evaluate(bsdf, wi, wo).T
    found = rgb / wo[2][:, None]
    error = np.abs(found - truth).max(axis=1)
    relative = error / (truth.max(axis=1) + 1e-3)
    quantiles = np.quantile(relative, [0.5, 0.9, 0.99])
    light = (error * wi[2] * wo[2]).sum() / (truth.max(axis=1) * wi[2] * wo[2]).sum()
    expect("f", quantiles[0] < MEDIAN and light < LIGHT,
           f"{len(truth)} directions, median difference {quantiles[0]:.2%}, 90 % below {quantiles[1]:.2%}, "
           f"99 % below {quantiles[2]:.2%}; of the reflected light {light:.2%}")
    picture = sphere(bsdf)
    tests = chi_square(rgb_file)
    expect("chi-square test", all(passed for passed, _ in tests),
           ", ".join(f"p = {p:.3f} at {angle} degrees" for (_, p), angle in zip(tests, INCIDENCES)))

    mi.set_variant("llvm_ad_spectral")
    bsdf = load(spectral_file)
    step = max(1, len(truth) // 2000)
    colours, least = linear_srgb(bsdf, wi[:, ::step], wo[:, ::step])
    error = np.abs(colours - rgb[::step]).max(axis=1) / (rgb[::step].max(axis=1) + 1e-6)
    expect("spectra", least >= 0 and error.max() < ROUND_TRIP,
           f"least value {least:.3g}, colours of {len(colours)} spectra differ by at most {error.max():.3%}")
    spectral_picture = sphere(bsdf)
    difference = np.abs(spectral_picture - picture).max() / picture.max()
    expect("picture", np.isfinite(picture).all() and picture.max() > 0 and difference < 0.02,
           f"mean colour {np.round(picture, 4)} in RGB, in spectra it differs by {difference:.2%}")

    mi.set_variant("scalar_rgb")
    expect("scalar variant", np.isfinite(sphere(load(rgb_file))).all(), "loads and renders")
    return not failures


def defaults(cli, folder):
    """Materials to check if none is named."""
    run(cli, "convert", "purple-paint", folder / "table.binary")
    run(cli, "fit", "ward", "-o", folder / "model.safetensors")
    return ["red-plastic", "cherry-235", "cook-torrance", folder / "table.binary", folder / "model.safetensors"]


def main():
    if len(sys.argv) < 2 or sys.argv[1] in ("-h", "--help"):
        sys.exit(__doc__.strip())
    cli = sys.argv[1]
    missing = [variant for variant in ("llvm_ad_rgb", "llvm_ad_spectral", "scalar_rgb") if variant not in mi.variants()]
    if missing:
        sys.exit(f"expected Mitsuba with the variants {', '.join(missing)}, found {', '.join(mi.variants())}")
    mi.set_log_level(mi.LogLevel.Error)
    print(f"Mitsuba {mi.__version__}")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        sources = sys.argv[2:] or defaults(cli, folder)
        bad = []
        for source in sources:
            print(source if isinstance(source, str) else source.name, flush=True)
            if not check(cli, source, folder):
                bad.append(str(source))
    if bad:
        sys.exit(f"not as expected: {', '.join(bad)}")
    print(f"{len(sources)} materials are as expected")


if __name__ == "__main__":
    main()

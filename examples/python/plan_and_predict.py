"""Plans twenty measurements of a material, makes them, fits a model and draws what it knows.

python examples/python/plan_and_predict.py [PICTURE]

The built-in material stands for an instrument: replace `measure` by your own.
"""

import sys

import gpbrdf
import matplotlib.pyplot as plt
import numpy as np

truth = gpbrdf.Source.built_in("red-plastic")


def measure(wi, wo):
    """What an instrument finds: values in 1/sr with one per cent of noise, and their standard deviations."""
    values = truth.eval(wi, wo)
    sigma = 0.01 * values
    return values + sigma * np.random.default_rng(0).standard_normal(values.shape), sigma


# Light and detector stay in one plane.
instrument = dict(incidences=[15, 30, 45, 60], theta_max=75, in_plane=True)
plan = gpbrdf.plan(count=20, **instrument)
values, sigma = measure(plan.wi, plan.wo)
samples = gpbrdf.Samples.from_directions(plan.wi, plan.wo, values, sigma=sigma, name="red plastic")
model = gpbrdf.fit(samples)
following = gpbrdf.plan(samples, count=10, **instrument)

figure, (curve, angles) = plt.subplots(1, 2, figsize=(11, 4.5), layout="constrained")


def signed(of):
    """The angles of the detector, positive on the side of the mirror direction."""
    return np.where(of.phi_o < 90, -of.theta_o, of.theta_o)


# A cut with the light at 30 degrees.
detector = np.linspace(-75, 75, 301)
wi = gpbrdf.direction(np.radians(30), 0.0)
wo = gpbrdf.direction(np.radians(np.abs(detector)), np.where(detector < 0, 0.0, np.pi))
predicted = model.predict(wi, wo)
curve.fill_between(detector, predicted.lower[:, 0], predicted.upper[:, 0], alpha=0.3, label="95 % interval")
curve.plot(detector, predicted.mean[:, 0], label="prediction from 20 measurements")
curve.plot(detector, truth.eval(wi, wo)[:, 0], "k--", linewidth=1, label="truth")
cut = plan.theta_i == 30
curve.errorbar(signed(plan)[cut], values[cut, 0], 2 * sigma[cut, 0], fmt="o", label="measured")
curve.set(xlabel="angle of the detector, degrees", ylabel="f (red), 1/sr", yscale="log", title="Light at 30 degrees")
curve.legend()

angles.plot(signed(plan), plan.theta_i, "o", label="measured")
angles.plot(signed(following), following.theta_i, "x", label="to measure next")
angles.set(xlabel="angle of the detector, degrees", ylabel="angle of the light, degrees")
angles.set(title=f"Expected error of ln f: {plan.errors[0]:.2f} before, {following.errors[0]:.2f} after")
angles.legend()

figure.savefig(sys.argv[1] if len(sys.argv) > 1 else "plan_and_predict.png", dpi=120)

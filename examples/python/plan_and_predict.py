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


plan = gpbrdf.plan(count=20, theta_max=75)
values, sigma = measure(plan.wi, plan.wo)
samples = gpbrdf.Samples.from_directions(plan.wi, plan.wo, values, sigma=sigma, name="red plastic")
model = gpbrdf.fit(samples)
following = gpbrdf.plan(samples, count=10, theta_max=75)

figure, (curve, hemisphere) = plt.subplots(1, 2, figsize=(11, 4.5), layout="constrained")

# A cut through the plane of incidence, with the light at 30 degrees.
angle = np.linspace(-75, 75, 301)
wi = gpbrdf.direction(np.radians(30), 0.0)
wo = gpbrdf.direction(np.radians(np.abs(angle)), np.where(angle < 0, 0.0, np.pi))
predicted = model.predict(wi, wo)
curve.fill_between(angle, predicted.lower[:, 0], predicted.upper[:, 0], alpha=0.3, label="95 % interval")
curve.plot(angle, predicted.mean[:, 0], label="prediction from 20 measurements")
curve.plot(angle, truth.eval(wi, wo)[:, 0], "k--", linewidth=1, label="truth")
in_cut = np.isclose(plan.theta_i, 30) & np.isin(plan.phi_o, [0, 180])
signed = np.where(plan.phi_o == 0, -plan.theta_o, plan.theta_o)
curve.errorbar(signed[in_cut], values[in_cut, 0], 2 * sigma[in_cut, 0], fmt="o", label="measured")
curve.set(xlabel="angle of the detector, degrees", ylabel="f (red), 1/sr", yscale="log", title="Light at 30 degrees")
curve.legend()

# Where the detector stands, seen from above; the light is on the right.
for some, marker, label in [(plan, "o", "measured"), (following, "x", "to measure next")]:
    azimuth = np.radians(some.phi_o)
    x, y = some.theta_o * np.cos(azimuth), some.theta_o * np.sin(azimuth)
    points = hemisphere.scatter(x, y, c=some.theta_i, marker=marker, vmin=0, vmax=75, label=label)
hemisphere.set(xlabel="degrees from the normal, towards the light", ylabel="degrees from the normal, to the side")
hemisphere.set(aspect="equal", title=f"Expected error of ln f: {plan.errors[0]:.2f} before, {plan.errors[-1]:.2f} after")
figure.colorbar(points, label="angle of the light, degrees")
hemisphere.legend()

figure.savefig(sys.argv[1] if len(sys.argv) > 1 else "plan_and_predict.png", dpi=120)

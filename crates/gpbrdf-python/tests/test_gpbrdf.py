"""The package against formulas and NumPy: python -m pytest, with the wheel installed."""

import _thread
import pathlib
import signal
import threading
import time

import gpbrdf
import numpy as np
import pytest


def hemisphere(count, seed, least=0.1):
    """Unit directions, uniform in solid angle, with a cosine of at least `least`."""
    random = np.random.default_rng(seed)
    z = random.uniform(least, 1, count)
    phi = random.uniform(0, 2 * np.pi, count)
    r = np.sqrt(1 - z * z)
    return np.stack([r * np.cos(phi), r * np.sin(phi), z], axis=1)


def lobe(wi, wo):
    """A diffuse colour and a lobe about the half vector."""
    h = wi + wo
    h /= np.linalg.norm(h, axis=-1, keepdims=True)
    return np.array([0.2, 0.1, 0.05]) + (0.5 * h[..., 2] ** 20)[..., None]


@pytest.fixture(scope="module")
def model():
    return gpbrdf.fit(gpbrdf.Source.built_in("red-plastic").measure(count=2000))


def test_angles_follow_rusinkiewicz():
    wi, wo = hemisphere(50, 1), hemisphere(50, 2)
    angles = gpbrdf.half_difference(wi, wo)
    h = (wi + wo) / np.linalg.norm(wi + wo, axis=1, keepdims=True)
    assert np.allclose(angles[:, 0], np.arccos(h[:, 2]))
    assert np.allclose(angles[:, 1], np.arccos(np.sum(h * wi, axis=1)))
    assert ((angles[:, 2] >= 0) & (angles[:, 2] <= np.pi)).all()
    assert np.allclose(gpbrdf.direction(np.pi / 2, [0.0, np.pi / 2]), np.eye(3)[:2])


def test_samples_keep_what_they_are_given(tmp_path):
    wi, wo = hemisphere(30, 3), hemisphere(30, 4)
    values = lobe(wi, wo)
    samples = gpbrdf.Samples.from_directions(wi, wo, values, sigma=0.01 * values, name="lobe")
    assert len(samples) == 30 and np.array_equal(samples.values, values)
    assert np.allclose(samples.wi, wi) and np.allclose(samples.wo, wo) and np.allclose(samples.sigma, 0.01 * values)
    assert np.array_equal(samples.subset([4, 2]).values, values[[4, 2]])
    samples.write(tmp_path / "lobe.csv")
    again = gpbrdf.Source(tmp_path / "lobe.csv")
    assert again.is_scattered and np.allclose(again.samples().values, values)
    same = gpbrdf.Samples.from_half_difference(gpbrdf.half_difference(wi, wo), values[:, 0])
    assert same.sigma is None and np.array_equal(same.values[:, 2], values[:, 0])


def test_arrays_of_any_order_and_type_are_read():
    wi, wo = hemisphere(20, 5), hemisphere(20, 6)
    source = gpbrdf.Source.built_in("red-plastic")
    truth = source.eval(wi, wo)
    assert np.array_equal(source.eval(np.asfortranarray(wi), wo[::-1][::-1]), truth)
    assert np.allclose(source.eval(wi.tolist(), wo.astype(np.float32)), truth, rtol=1e-3)
    assert np.array_equal(source.eval(wi[0], wo), source.eval(np.repeat(wi[:1], 20, axis=0), wo))


def test_scattered_samples_are_fitted_and_predicted():
    wi, wo = hemisphere(300, 7), hemisphere(300, 8)
    model = gpbrdf.fit(gpbrdf.Samples.from_directions(wi, wo, lobe(wi, wo)))
    assert model.solver == "scattered" and model.n_samples == 300 and model.log_marginal_likelihood > 0
    wi, wo = hemisphere(200, 9, 0.3), hemisphere(200, 10, 0.3)
    found, truth = model.predict(wi, wo), lobe(wi, wo)
    assert np.median(np.abs(np.log(found.mean / truth))) < 0.02
    assert np.mean((found.lower <= truth) & (truth <= found.upper)) > 0.85
    latent = model.predict(half_difference=gpbrdf.half_difference(wi, wo), of="latent")
    assert np.allclose(latent.mean, found.mean, rtol=1e-6)
    assert (latent.upper - latent.lower <= found.upper - found.lower + 1e-12).all()


def test_tables_hold_predictions(model):
    baked = model.bake()
    assert baked.mean.shape == baked.sigma.shape == (90, 90, 180, 3) and baked.mean.dtype == np.float32
    assert baked.mean is baked.mean
    h, d, p = 20, 30, 90
    center = [((h + 0.5) / 90) ** 2 * np.pi / 2, (d + 0.5) / 90 * np.pi / 2, (p + 0.5) / 180 * np.pi]
    found = model.predict(half_difference=center, of="latent")
    assert np.allclose(baked.mean[h, d, p], found.mean[0], rtol=1e-4)
    g = np.log(found.mean[0] + 1e-3) + 1.959964 * baked.sigma[h, d, p]
    assert np.allclose(np.exp(g) - 1e-3, found.upper[0], rtol=1e-3)
    assert np.allclose(model.predict(half_difference=center).mean, found.mean)


def test_models_are_saved_bit_for_bit(model, tmp_path):
    model.save(tmp_path / "model.safetensors")
    again = gpbrdf.Model.load(tmp_path / "model.safetensors")
    wi, wo = hemisphere(50, 11), hemisphere(50, 12)
    assert np.array_equal(again.predict(wi, wo).mean, model.predict(wi, wo).mean)
    assert again.log_marginal_likelihood is None and again.name == "red-plastic"
    assert gpbrdf.Source(tmp_path / "model.safetensors").kind.endswith("model")


def test_merl_files_are_read_by_their_published_layout(model, tmp_path):
    model.write(tmp_path / "t.binary")
    raw = (tmp_path / "t.binary").read_bytes()
    assert np.frombuffer(raw[:12], "<i4").tolist() == [90, 90, 180]
    planes = np.frombuffer(raw[12:], "<f8").reshape(3, 90, 90, 180)
    scale = np.array([1 / 1500, 1.15 / 1500, 1.66 / 1500])
    assert np.allclose(np.moveaxis(planes, 0, -1) * scale, model.bake().mean, rtol=1e-5)
    assert np.allclose(gpbrdf.Source(tmp_path / "t.binary").table(), model.bake().mean, rtol=1e-5)


def test_textures_are_arrays_of_numpy(model, tmp_path):
    model.write(tmp_path / "t.npy")
    texture = np.load(tmp_path / "t.npy")
    assert texture.shape == (180, 90, 90, 4)
    baked = model.bake()
    assert np.allclose(texture[..., :3], baked.mean.transpose(2, 1, 0, 3), rtol=1e-3, atol=1e-6)
    assert np.allclose(texture[..., 3], baked.sigma[..., 0].transpose(2, 1, 0), rtol=1e-3, atol=1e-6)


def test_materials_sample_what_they_evaluate():
    material = gpbrdf.Source.built_in("red-plastic").material()
    wo = np.array([[0.6, 0, 0.8]], np.float32)
    u = np.random.default_rng(13).random((200_000, 2), np.float32)
    wi, weight, pdf = material.sample(wo, u)
    good = pdf > 0
    assert wi.dtype == np.float32 and good.mean() > 0.999
    f = material.eval(wi[good], wo)
    assert np.allclose(weight[good] * pdf[good, None], f * wi[good, 2:], rtol=1e-3, atol=1e-6)
    assert np.median(np.abs(material.pdf(wi[good], wo) / pdf[good] - 1)) < 1e-4
    # The mean weight is the albedo, and so is the integral over uniform directions.
    albedo = material.albedo(wo)[0]
    assert np.allclose(weight.mean(axis=0), albedo, rtol=0.01)
    uniform = hemisphere(400_000, 14, 0).astype(np.float32)
    integral = 2 * np.pi * (material.eval(uniform, wo) * uniform[:, 2:]).mean(axis=0)
    assert np.allclose(integral, albedo, rtol=0.03)
    assert np.allclose(2 * np.pi * material.pdf(uniform, wo).mean(), 1, rtol=0.03)
    assert (material.eval([0, 0, -1], wo) == 0).all()


def test_a_constant_table_is_a_diffuser():
    material = gpbrdf.Material(np.full((90, 90, 180, 3), 0.5 / np.pi, np.float32))
    assert np.allclose(material.albedo(hemisphere(10, 15)), 0.5, rtol=1e-3)
    white = gpbrdf.Material(np.ones((90, 90, 180, 3)), energy_conserving=True)
    assert (white.albedo(hemisphere(10, 15)) <= 1.001).all()


def test_plans_keep_the_limits_of_the_instrument():
    plan = gpbrdf.plan(count=6, step=10, theta_max=60, incidences=[10, 30], in_plane=True)
    assert set(plan.theta_i) <= {10.0, 30.0} and (plan.theta_o <= 60).all() and set(plan.phi_o) <= {0.0, 180.0}
    assert np.allclose(gpbrdf.direction(np.radians(plan.theta_o), np.radians(plan.phi_o)), plan.wo)
    assert plan.errors.shape == (7,) and (np.diff(plan.errors) < 0).all() and sorted(plan.tour) == list(range(6))
    measured = gpbrdf.Samples.from_directions(plan.wi, plan.wo, lobe(plan.wi, plan.wo))
    following = gpbrdf.plan(measured, count=3)
    assert following.errors[0] < plan.errors[0] and len(following.theta_i) == 3


@pytest.mark.parametrize(
    ("layout", "count"),
    [("lattice", 240), ("random", 50), ("cells", 50), ("hemisphere", 50), ("in-plane", 50), ("gonio", 90)],
)
def test_layouts_measure_the_source(layout, count):
    source = gpbrdf.Source.built_in("ward")
    samples = source.measure(layout, count=count)
    assert abs(len(samples) / count - 1) < 0.3
    assert np.allclose(samples.values, source.eval(samples.wi, samples.wo), rtol=1e-6)


def test_errors_say_what_was_expected(tmp_path):
    source = gpbrdf.Source.built_in("ward")
    with pytest.raises(FileNotFoundError, match="absent.binary"):
        gpbrdf.Source(tmp_path / "absent.binary")
    with pytest.raises(ValueError, match="red-plastic"):
        gpbrdf.Source.built_in("red plastic")
    with pytest.raises(ValueError, match=r"wi: expected an array of shape \(n, 3\) or \(3,\), found shape \(2, 2\)"):
        source.eval(np.ones((2, 2)), [0, 0, 1])
    with pytest.raises(ValueError, match="wi, row 1: expected a unit vector, found length 2"):
        source.eval([[0, 0, 1], [0, 0, 2]], [0, 0, 1])
    with pytest.raises(ValueError, match="above the horizon"):
        source.eval([0, 0, -1], [0, 0, 1])
    with pytest.raises(ValueError, match="the same number of rows"):
        source.eval(hemisphere(3, 16), hemisphere(2, 17))
    with pytest.raises(ValueError, match="values, row 0: expected finite numbers"):
        gpbrdf.Samples.from_directions([0, 0, 1], [0, 0, 1], [np.nan])
    with pytest.raises(ValueError, match="solver: expected one of"):
        gpbrdf.fit(source.measure(count=100), solver="exact")
    with pytest.raises(ValueError, match="found .png"):
        source.write(tmp_path / "t.png")
    with pytest.raises(ValueError, match="^lobe: expected a BRDF"):
        samples = gpbrdf.Samples.from_directions([0, 0, 1], [0, 0, 1], [1.0], name="lobe")
        samples.write(tmp_path / "t.exr")
    with pytest.raises(OSError):
        source.write(tmp_path / "absent" / "t.binary")
    assert not list(pathlib.Path(tmp_path).iterdir())
    with pytest.raises(IndexError):
        source.measure(count=100).subset([10_000])
    with pytest.raises(ValueError, match="number of samples"):
        source.measure(shape=(100_000, 100_000, 100_000))


def long_fit(progress=None):
    wi, wo = hemisphere(8000, 18), hemisphere(8000, 19)
    return gpbrdf.fit(gpbrdf.Samples.from_directions(wi, wo, lobe(wi, wo)), progress=progress)


def test_control_c_stops_a_fit():
    # A process that a script starts in the background ignores the signal, and Python then has no handler for it.
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    timer = threading.Timer(0.5, _thread.interrupt_main)
    timer.start()
    started = time.monotonic()
    try:
        with pytest.raises(KeyboardInterrupt):
            long_fit()
    finally:
        signal.signal(signal.SIGINT, before)
    assert time.monotonic() - started < 5


def test_progress_is_told_and_its_exceptions_stop_a_fit():
    shares = []

    def progress(share):
        shares.append(share)
        if len(shares) == 3:
            raise RuntimeError("enough")

    with pytest.raises(RuntimeError, match="enough"):
        long_fit(progress)
    assert len(shares) == 3 and shares == sorted(shares) and 0 <= shares[0] <= shares[-1] <= 1


def test_other_threads_run_during_work():
    counted = 0
    done = threading.Event()

    def count():
        nonlocal counted
        while not done.is_set():
            counted += 1
            time.sleep(0.001)

    thread = threading.Thread(target=count)
    thread.start()
    gpbrdf.Source.built_in("red-plastic").material()
    during = counted
    done.set()
    thread.join()
    assert during > 3

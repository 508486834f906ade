// Radial shapes of kernels by their names in gpbrdf-core, as functions of the squared scaled distance r2 and, where the
// shape has one, of alpha. A shape without a function here is not baked on devices. Needs bake/real.wgsl.

fn se(r2: real) -> real {
    return exp_real(real(-0.5) * r2);
}

fn rq(r2: real, alpha: real) -> real {
    return exp_real(-alpha * log_real(real(1.0) + r2 / (real(2.0) * alpha)));
}

fn matern12(r2: real) -> real {
    return exp_real(-sqrt(r2));
}

fn matern32(r2: real) -> real {
    let s = sqrt(real(3.0) * r2);
    return (real(1.0) + s) * exp_real(-s);
}

fn matern52(r2: real) -> real {
    let s = sqrt(real(5.0) * r2);
    return (real(1.0) + s + s * s * real(0.3333333333333333)) * exp_real(-s);
}

// Radial shapes of kernels, as functions of the squared scaled distance r2. Needs bake/real.wgsl.

fn squared_exponential(r2: real) -> real {
    return exp_real(real(-0.5) * r2);
}

fn rational_quadratic(r2: real, alpha: real) -> real {
    return exp_real(-alpha * log_real(real(1.0) + r2 / (real(2.0) * alpha)));
}

fn matern_1_2(r2: real) -> real {
    return exp_real(-sqrt(r2));
}

fn matern_3_2(r2: real) -> real {
    let s = sqrt(real(3.0) * r2);
    return (real(1.0) + s) * exp_real(-s);
}

fn matern_5_2(r2: real) -> real {
    let s = sqrt(real(5.0) * r2);
    return (real(1.0) + s + s * s * real(0.3333333333333333)) * exp_real(-s);
}

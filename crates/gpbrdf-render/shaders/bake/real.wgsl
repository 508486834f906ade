// exp and ln of `real`, which is f32 or f64: WGSL's own functions have no f64.
//
// Composed with the definition of `real`.

// exp(x) for x <= 0 to the last places of `real`; 0 below -86. The same polynomial as `exp` of simd.rs in
// gpbrdf-core.
fn exp_real(x: real) -> real {
    if x < real(-86.0) {
        return real(0.0);
    }
    let n = round(f32(x) * 1.44269504);
    let r = (x - real(n) * real(0.693145751953125)) - real(n) * real(1.42860682030941723212e-6);
    var p = real(1.6059043836821613e-10);
    p = p * r + real(2.08767569878681e-9);
    p = p * r + real(2.505210838544172e-8);
    p = p * r + real(2.755731922398589e-7);
    p = p * r + real(2.7557319223985893e-6);
    p = p * r + real(2.48015873015873e-5);
    p = p * r + real(1.984126984126984e-4);
    p = p * r + real(1.388888888888889e-3);
    p = p * r + real(8.333333333333333e-3);
    p = p * r + real(4.1666666666666664e-2);
    p = p * r + real(1.6666666666666666e-1);
    p = p * r + real(0.5);
    p = p * r + real(1.0);
    p = p * r + real(1.0);
    return p * real(bitcast<f32>(u32(i32(n) + 127) << 23u));
}

// ln(x) for x >= 1: the built-in function, and a step of Halley's method on exp(y) = x.
fn log_real(x: real) -> real {
    let y = real(log(f32(x)));
    let e = x * exp_real(-y);
    return y + real(2.0) * (e - real(1.0)) / (e + real(1.0));
}

//! A baked material in a wgpu program of one's own: `cargo run --release -p gpbrdf-render --example texture_in_wgpu`.
//!
//! The program opens its device as any other, hands it to this crate to bake a model into a texture, and evaluates that
//! texture in a compute shader of its own, behind [`LOOKUP_WGSL`]: the light that a plane lit from the side reflects
//! towards a row of viewers. It prints the values beside those of the table on the CPU.
#![expect(clippy::print_stdout, reason = "an example reports to a terminal")]

use std::ops::ControlFlow;

use gpbrdf_core::brdf::direction;
use gpbrdf_core::{
    Brdf, FitOptions, LatticeLayout, Layout, Model, Source, Symmetry, bake_mean, fit, nalgebra,
};
use gpbrdf_render::{Baker, BrdfTexture, Context, LOOKUP_WGSL, Precision};

type Result<T = (), E = Box<dyn std::error::Error>> = std::result::Result<T, E>;

/// Viewers, from straight above down to grazing.
const COUNT: u16 = 16;

/// Polar angle of the light, degrees.
const LIGHT: f64 = 40.0;

/// Our own shader; the lookup stands in front of it.
const SHADER: &str = "
@group(0) @binding(0) var table: texture_3d<f32>;
@group(0) @binding(1) var filtering: sampler;
@group(0) @binding(2) var<storage, read> light: vec4f;
@group(0) @binding(3) var<storage, read> viewers: array<vec4f>;
@group(0) @binding(4) var<storage, read_write> reflected: array<vec4f>;

@compute @workgroup_size(16)
fn reflect_light(@builtin(global_invocation_id) id: vec3u) {
    let f = gpbrdf_lookup(table, filtering, light.xyz, viewers[id.x].xyz);
    reflected[id.x] = vec4f(f.rgb * light.z, f.a);
}
";

fn main() -> Result {
    let (adapter, device, queue) = open_device()?;
    println!("on {}", adapter.get_info().name);
    let context = Context::from_device(&adapter, device, queue);

    let model = fit_material()?;
    let texture =
        Baker::new(&context)?.bake(&model, Precision::Half, &mut |_done| ControlFlow::Continue(()))?;

    let wi = direction(LIGHT.to_radians(), 0.0);
    let viewers: Vec<_> = (0..COUNT)
        .map(|i| direction(80f64.to_radians() * f64::from(i) / f64::from(COUNT), std::f64::consts::PI))
        .collect();
    let found = evaluate(&context, &texture, narrow(&wi), &viewers.iter().map(narrow).collect::<Vec<_>>())?;

    let table = bake_mean(&model);
    let mut worst = 0f64;
    for (wo, found) in viewers.iter().zip(&found) {
        let expected = table.eval(&wi, wo).map(|f| f * wi.z);
        let gap = (0..3).map(|c| (f64::from(found[c]) - expected[c]).abs() / (expected[c] + 1e-3));
        worst = gap.fold(worst, f64::max);
        println!(
            "viewer at {:4.1} degrees: shader {:.4}, CPU {:.4}, sigma {:.4}",
            wo.z.acos().to_degrees(),
            found[0],
            expected[0],
            found[3]
        );
    }
    // Samplers round their weights to 1/256, and texels have 11 bits.
    if worst > 0.02 {
        return Err(format!(
            "shader and CPU: expected at most 2 % between them, found {:.1} %",
            100.0 * worst
        )
        .into());
    }
    println!("shader and CPU differ by at most {:.2} %", 100.0 * worst);
    Ok(())
}

/// The device of a program that knows nothing of BRDFs, but for the limits and features that are asked for.
fn open_device() -> Result<(wgpu::Adapter, wgpu::Device, wgpu::Queue)> {
    let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle_from_env());
    let adapter = pollster::block_on(instance.request_adapter(&wgpu::RequestAdapterOptions::default()))?;
    let descriptor = wgpu::DeviceDescriptor {
        label: Some("example"),
        required_features: adapter.features() & Context::OPTIONAL_FEATURES,
        required_limits: Context::required_limits(&adapter),
        ..Default::default()
    };
    let (device, queue) = pollster::block_on(adapter.request_device(&descriptor))?;
    Ok((adapter, device, queue))
}

/// Red plastic from some 1,500 measurements.
fn fit_material() -> Result<Model> {
    let layout = LatticeLayout::with_samples(1500, Symmetry::Bilateral)?;
    let samples = Source::built_in("red-plastic")?.measure(&Layout::Lattice(layout))?;
    Ok(fit(&samples, &FitOptions::default())?.model)
}

/// One dispatch of [`SHADER`]: red, green and blue that each viewer sees, and sigma.
fn evaluate(
    context: &Context,
    texture: &BrdfTexture,
    light: [f32; 4],
    viewers: &[[f32; 4]],
) -> Result<Vec<[f32; 4]>> {
    let storage = wgpu::BufferUsages::STORAGE;
    let source = format!("{LOOKUP_WGSL}{SHADER}");
    let pipeline = context.compute_pipeline("reflected light", &source, "reflect_light")?;
    let light = context.buffer_of("light", bytemuck::bytes_of(&light), storage)?;
    let size = std::mem::size_of_val(viewers) as u64;
    let viewers = context.buffer_of("viewers", bytemuck::cast_slice(viewers), storage)?;
    let reflected = context.empty_buffer("reflected", size, storage | wgpu::BufferUsages::COPY_SRC)?;
    let sampler = BrdfTexture::sampler(context);
    let resources = [
        wgpu::BindingResource::TextureView(texture.view()),
        wgpu::BindingResource::Sampler(&sampler),
        light.as_entire_binding(),
        viewers.as_entire_binding(),
        reflected.as_entire_binding(),
    ];
    let entries: Vec<_> =
        (0..).zip(resources).map(|(binding, resource)| wgpu::BindGroupEntry { binding, resource }).collect();
    let group = context.device().create_bind_group(&wgpu::BindGroupDescriptor {
        label: Some("reflected light"),
        layout: &pipeline.get_bind_group_layout(0),
        entries: &entries,
    });
    let mut encoder = context.device().create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
    pass.set_pipeline(&pipeline);
    pass.set_bind_group(0, &group, &[]);
    pass.dispatch_workgroups(1, 1, 1);
    drop(pass);
    context.queue().submit([encoder.finish()]);
    let bytes = context.read_buffer(&reflected)?;
    Ok(bytes.chunks_exact(16).map(bytemuck::pod_read_unaligned).collect())
}

#[expect(clippy::cast_possible_truncation, reason = "the shader's precision")]
fn narrow(w: &nalgebra::Vector3<f64>) -> [f32; 4] {
    [w.x as f32, w.y as f32, w.z as f32, 0.0]
}

//! What a device rejects, and a device that is lost, are errors, whoever meets them.

use gpbrdf_render::{AdapterChoice, Context, Error, wgpu};

crate::support::gpu_tests![
    a_device_that_is_lost_between_two_steps_is_an_error,
    what_is_rejected_outside_of_a_guard_is_told_by_the_next_one,
];

/// A device of this test alone.
fn own() -> Context {
    Context::open(AdapterChoice::Any).unwrap()
}

fn a_device_that_is_lost_between_two_steps_is_an_error(_shared: &Context) {
    let context = own();
    let buffer = context.buffer_of("bytes", &[1; 64], wgpu::BufferUsages::STORAGE).unwrap();
    context.device().destroy();
    // Outside of any guard.
    context.queue().write_buffer(&buffer, 0, &[2; 64]);
    let found = context.buffer_of("more bytes", &[1; 64], wgpu::BufferUsages::STORAGE).unwrap_err();
    assert!(matches!(found, Error::Lost { .. }), "{found}");
    assert!(matches!(context.wait("work").unwrap_err(), Error::Lost { .. }));
}

fn what_is_rejected_outside_of_a_guard_is_told_by_the_next_one(_shared: &Context) {
    let context = own();
    let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST;
    let buffer = context.buffer_of("bytes", &[1; 64], usage).unwrap();
    // Beyond its end.
    for tell in [|context: &Context| context.wait("work"), |context: &Context| context.guard("work", || ())] {
        context.queue().write_buffer(&buffer, 64, &[2; 64]);
        let found = tell(&context).unwrap_err().to_string();
        assert!(found.starts_with("work: ") && found.contains("bytes"), "{found}");
        // It is told once.
        tell(&context).unwrap();
    }
}

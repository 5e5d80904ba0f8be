//! Which adapter is opened, and what is said when none fits.

use spao_server::gpu::{Gpu, GpuError, GpuOptions};
use spao_server::render_thread::RenderHandle;
use spao_server::renderer::RenderError;

fn open(options: &GpuOptions) -> Result<Gpu, String> {
    Gpu::new(options).map_err(|e| match e {
        GpuError::NoAdapter(message) => message,
        other => panic!("{other}"),
    })
}

fn name() -> String {
    open(&GpuOptions::default()).expect("tests need an adapter; a software one will do").adapter.name
}

#[test]
fn an_adapter_is_found_by_a_part_of_its_name_in_any_case() {
    let name = name();
    let part: String = name.chars().take(5).collect();
    for text in [part.to_uppercase(), part.to_lowercase(), name.clone()] {
        let options = GpuOptions { adapter: Some(text), ..GpuOptions::default() };
        assert_eq!(open(&options).expect("it was there a moment ago").adapter.name, name);
    }
}

#[test]
fn a_name_that_nothing_has_is_an_error_that_lists_what_was_found() {
    let options = GpuOptions { adapter: Some("Voodoo 2".into()), ..GpuOptions::default() };
    let message = open(&options).expect_err("no such adapter");
    assert!(message.contains("`Voodoo 2`") && message.contains(&name()), "{message}");
    // The server's way to a device says the same.
    match RenderHandle::spawn(options) {
        Err(RenderError::NoAdapter(said)) => assert_eq!(said, message),
        other => panic!("{other:?}"),
    }
}

#[test]
fn a_software_adapter_is_refused_where_a_hardware_one_is_required() {
    let gpu = open(&GpuOptions::default()).expect("tests need an adapter; a software one will do");
    for adapter in [None, Some(gpu.adapter.name.clone())] {
        let required = open(&GpuOptions { require_gpu: true, adapter: adapter.clone(), ..GpuOptions::default() });
        if gpu.is_software() {
            let message = required.expect_err("software adapters only come when there is no other");
            assert!(message.contains("hardware") && message.contains(&gpu.adapter.name), "{message}");
            assert!(adapter.is_none_or(|name| message.contains(&format!("`{name}`"))), "{message}");
        } else {
            assert!(!required.expect("this machine has one").is_software());
        }
    }
}

#[test]
fn limits_and_features_can_be_lowered_so_that_fallbacks_run_anywhere() {
    let gpu = open(&GpuOptions::default()).expect("an adapter");
    let lower = open(&GpuOptions {
        baseline_features_only: true,
        max_storage_binding_bytes: Some(1 << 20),
        ..GpuOptions::default()
    })
    .expect("less than it has");
    assert!(!lower.texture_16bit_norm);
    assert_eq!(lower.limits.max_storage_buffer_binding_size, 1 << 20);
    let raised = open(&GpuOptions { max_storage_binding_bytes: Some(u64::MAX), ..GpuOptions::default() });
    let raised = raised.expect("never more than it has").limits.max_storage_buffer_binding_size;
    assert_eq!(raised, gpu.limits.max_storage_buffer_binding_size);
}

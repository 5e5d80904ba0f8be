//! Counted allocations, and errors that stay with the job that made them.

use spao_server::gpu::{Category, ComputeStage, Gpu, GpuError, GpuOptions, Recorder, default_budget_bytes};
use wgpu::{BufferUsages, TextureFormat, TextureUsages};

const MIB: u64 = 1 << 20;

fn gpu(budget_bytes: u64) -> Gpu {
    let options = GpuOptions { memory_budget_bytes: Some(budget_bytes), ..GpuOptions::default() };
    Gpu::new(&options).expect("tests need an adapter; a software one will do")
}

fn storage() -> BufferUsages {
    BufferUsages::STORAGE | BufferUsages::COPY_DST | BufferUsages::COPY_SRC
}

#[track_caller]
fn assert_out_of_memory<T: std::fmt::Debug>(result: Result<T, GpuError>, label: &str, numbers: [u64; 3]) {
    let error = result.expect_err("an error");
    let GpuError::OutOfMemory { what, needed_bytes, used_bytes, budget_bytes } = &error else { panic!("{error}") };
    assert_eq!((what.as_str(), [*needed_bytes, *used_bytes, *budget_bytes]), (label, numbers), "{error}");
    for number in numbers {
        assert!(error.to_string().contains(&number.to_string()), "{error}");
    }
}

/// A buffer can be written and read: the device works.
#[track_caller]
fn assert_works(gpu: &Gpu) {
    let from = gpu.buffer("from", Category::Frame, 8, storage()).expect("a small buffer fits");
    let usage = BufferUsages::MAP_READ | BufferUsages::COPY_DST;
    let to = gpu.buffer("to", Category::Frame, 8, usage).expect("a small buffer fits");
    let mut recorder = Recorder::new(gpu, "copy");
    recorder.copy(&from, &to, 8);
    let read = recorder.run_and_read(gpu, &to, 8, <[u8]>::to_vec).expect("the device works");
    assert_eq!(read, [0; 8], "new buffers are zeroed");
}

#[test]
fn a_software_adapter_shares_main_memory_with_the_host_and_a_card_has_its_own() {
    assert_eq!(default_budget_bytes(true, || 6 << 30), 3 << 30);
    assert_eq!(default_budget_bytes(false, || unreachable!("its memory is its own")), 4 << 30);
    let gpu = Gpu::new(&GpuOptions::default()).expect("tests need an adapter; a software one will do");
    let expected = if gpu.is_software() { 64 * MIB..1 << 50 } else { 4 << 30..(4 << 30) + 1 };
    assert!(expected.contains(&gpu.budget.limit_bytes()), "{}", gpu.budget.limit_bytes());
}

#[test]
fn bytes_are_counted_by_purpose_while_an_allocation_lives() {
    let gpu = gpu(64 * MIB);
    assert_eq!((gpu.budget.limit_bytes(), gpu.budget.used_bytes()), (64 * MIB, 0));
    let volume = gpu
        .texture_3d("values", Category::Volume, [10, 20, 30], TextureFormat::Rgba8Snorm, TextureUsages::TEXTURE_BINDING)
        .expect("it fits");
    let levels = gpu.buffer("level", Category::AoScratch, MIB + 1, storage()).expect("it fits");
    let more = gpu.buffer("level", Category::AoScratch, 0, storage()).expect("it fits");
    // Whole words, and never nothing.
    assert_eq!([volume.bytes(), levels.bytes(), more.bytes()], [24_000, MIB + 4, 4]);
    let used = |gpu: &Gpu| {
        [Category::Volume, Category::AoCache, Category::AoScratch, Category::Frame].map(|c| gpu.budget.used_by(c))
    };
    assert_eq!(used(&gpu), [24_000, 0, MIB + 8, 0]);
    assert_eq!(gpu.budget.used_bytes(), 24_000 + MIB + 8);
    drop(levels);
    assert_eq!(used(&gpu), [24_000, 0, 4, 0]);
    drop((volume, more));
    assert_eq!(used(&gpu), [0; 4]);
}

#[test]
fn what_is_over_the_budget_is_refused_with_numbers_and_fits_once_there_is_room() {
    let gpu = gpu(4 * MIB);
    let first = gpu.buffer("first", Category::Volume, 3 * MIB, storage()).expect("it fits");
    let second = |gpu: &Gpu| gpu.buffer("second", Category::Frame, 2 * MIB, storage());
    assert_out_of_memory(second(&gpu), "second", [2 * MIB, 3 * MIB, 4 * MIB]);
    assert_eq!(gpu.budget.used_bytes(), 3 * MIB, "a refusal counts nothing");
    let texture =
        gpu.texture_3d("t", Category::Volume, [128; 3], TextureFormat::R8Unorm, TextureUsages::TEXTURE_BINDING);
    assert_out_of_memory(texture, "t", [2 * MIB, 3 * MIB, 4 * MIB]);
    assert_out_of_memory(gpu.budget.check("plan", MIB + 1), "plan", [MIB + 1, 3 * MIB, 4 * MIB]);
    gpu.budget.check("plan", MIB).expect("to the last byte");
    drop(first);
    second(&gpu).expect("there is room now");
    assert_works(&gpu);
}

#[test]
fn what_no_adapter_can_hold_is_an_error_and_no_panic() {
    let gpu = gpu(u64::MAX);
    let largest = gpu.limits.max_buffer_size;
    // Only above the limit if the limit is a limit.
    for bytes in [largest.saturating_add(4), u64::MAX - 1, u64::MAX] {
        let needed = bytes.checked_next_multiple_of(4).unwrap_or(u64::MAX);
        assert_out_of_memory(gpu.buffer("b", Category::Volume, bytes, storage()), "b", [needed, 0, u64::MAX]);
    }
    let longest = gpu.limits.max_texture_dimension_3d;
    let usage = TextureUsages::TEXTURE_BINDING;
    let texture = |dims| gpu.texture_3d("t", Category::Volume, dims, TextureFormat::R8Unorm, usage);
    let error = texture([longest + 1, 1, 1]).expect_err("longer than a texture can be");
    assert!(matches!(error, GpuError::Device(_)), "{error}");
    let error = texture([0, 1, 1]).expect_err("nothing at all");
    assert!(matches!(error, GpuError::Device(_)), "{error}");
    assert_eq!(gpu.budget.used_bytes(), 0);
    assert_works(&gpu);
}

#[test]
fn a_validation_error_is_the_error_of_its_job_and_the_device_works_on() {
    let gpu = gpu(16 * MIB);
    let small = gpu.buffer("small", Category::Frame, 16, storage()).expect("it fits");
    let large = gpu.buffer("large", Category::Frame, 64, storage()).expect("it fits");
    let overrun = |from, to| {
        gpu.guarded("a copy", || {
            let mut recorder = Recorder::new(&gpu, "copy");
            recorder.copy(from, to, 64);
            recorder.run(&gpu)
        })
    };
    let error = overrun(&large, &small).expect_err("64 bytes do not fit into 16");
    let GpuError::Device(message) = &error else { panic!("{error}") };
    assert!(message.starts_with("a copy: "), "{message}");
    // The same into a buffer that is large enough is no error: the one before left nothing behind.
    let other = gpu.buffer("other", Category::Frame, 64, storage()).expect("it fits");
    overrun(&large, &other).expect("64 bytes fit into 64");
    assert!(!gpu.is_lost());
    assert_works(&gpu);
}

#[test]
fn a_refused_allocation_inside_a_job_is_its_own_error_and_not_the_jobs() {
    let gpu = gpu(16 * MIB);
    // Storage that the host can map needs a feature that is not asked for.
    let usage = BufferUsages::STORAGE | BufferUsages::MAP_READ;
    let survived = gpu.guarded("a job", || {
        let error = gpu.buffer("mappable", Category::Frame, 16, usage).expect_err("a feature is missing");
        assert!(matches!(&error, GpuError::Device(message) if message.starts_with("mappable: ")), "{error}");
        Ok(7)
    });
    assert_eq!(survived.expect("nothing else went wrong"), 7);
    assert_eq!(gpu.budget.used_bytes(), 0);
    let own = gpu.guarded("a job", || Err::<(), _>(GpuError::Device("its own".into())));
    assert!(matches!(own, Err(GpuError::Device(message)) if message == "its own"));
    assert_works(&gpu);
}

#[test]
fn a_pass_that_cannot_be_compiled_is_an_error_that_names_it() {
    let gpu = gpu(16 * MIB);
    let error = |result: Result<ComputeStage, GpuError>| match result {
        Err(GpuError::Device(message)) => message,
        other => panic!("{other:?}"),
    };
    let unknown = error(ComputeStage::new(&gpu, "no_such_pass", &[], &[], &[]));
    assert!(unknown.contains("no_such_pass"), "{unknown}");
    let levels = error(ComputeStage::new(&gpu, "ao_spao", &[], &[], &[]));
    assert!(levels.contains("spao_sampled.wgsl") && levels.contains("LEVELS"), "{levels}");
    let constant = error(ComputeStage::new(&gpu, "ao_classify", &[], &[], &[("NO_SUCH_CONSTANT", 1.0)]));
    assert!(constant.starts_with("ao_classify: "), "{constant}");
    ComputeStage::new(&gpu, "ao_classify", &[], &[], &[]).expect("this one is fine");
    assert_works(&gpu);
}

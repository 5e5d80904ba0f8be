//! What tests share: one renderer for the whole binary, and the real program.

pub(crate) mod process;

use std::sync::OnceLock;

use spao_server::gpu::GpuOptions;
use spao_server::render_thread::RenderHandle;

/// The render thread of this test binary. A missing adapter fails the test: a skipped test proves nothing.
pub(crate) fn renderer() -> RenderHandle {
    static RENDERER: OnceLock<RenderHandle> = OnceLock::new();
    let open = || RenderHandle::spawn(GpuOptions::default()).expect("tests need an adapter; a software one will do").0;
    RENDERER.get_or_init(open).clone()
}

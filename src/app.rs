//! The server's life: open the renderer, load what the command line names, serve, drain.

use std::io::Write;
use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr};
use std::time::{Duration, Instant};

use anyhow::{Context, anyhow};
use axum::serve::ListenerExt;
use serde_json::json;
use tokio::net::TcpListener;
use tokio::sync::oneshot;

use crate::api::{AppState, Phase, router};
use crate::config::ServeArgs;
use crate::render_thread::{RenderHandle, RenderThread};
use crate::session::{LoadRequest, Waiting};

/// Id of the scene of the first volume on the command line.
const DEFAULT_SCENE: &str = "default";

/// How often the render thread's pulse is felt.
const PULSE: Duration = Duration::from_millis(500);

/// Serves until SIGTERM or SIGINT, then drains. Once the server is ready, `out` gets the lines for people.
///
/// # Errors
/// The address cannot be bound, no adapter can be had, a volume cannot be loaded, or the renderer ends.
pub async fn serve(config: ServeArgs, out: &mut dyn Write) -> anyhow::Result<()> {
    // Before anybody can know that there is a server.
    let stopped_by = stop_signal()?;
    let listener = TcpListener::bind(config.addr).await.with_context(|| format!("cannot listen on {}", config.addr))?;
    let address = listener.local_addr()?;
    let options = config.gpu.options();
    let (renderer, thread) = tokio::task::spawn_blocking(move || RenderHandle::spawn(options)).await??;
    let info = renderer.info();
    tracing::info!(
        adapter = info.adapter,
        backend = info.backend,
        driver = info.driver_info,
        software = info.software,
        "adapter"
    );

    let state = AppState::new(&config, renderer);
    let (stop, stopped) = oneshot::channel::<()>();
    // Small answers should not wait for more to send.
    let listener = listener.tap_io(|stream| {
        let _ = stream.set_nodelay(true);
    });
    let service = axum::serve(listener, router(state.clone())).with_graceful_shutdown(async {
        let _ = stopped.await;
    });
    let server = tokio::spawn(service.into_future());

    let work = async {
        preload(&state, &config.volumes).await?;
        state.lifecycle.enter(Phase::Serving);
        announce(out, &state, address)?;
        watch_renderer(&state).await
    };
    let outcome = tokio::select! {
        outcome = work => outcome,
        signal = stopped_by => {
            tracing::info!(signal, "draining");
            Ok(())
        }
    };
    drain(state, server, stop, thread, config.drain_timeout).await;
    outcome
}

/// Loads the volumes of the command line, each with a default scene.
async fn preload(state: &AppState, volumes: &[String]) -> anyhow::Result<()> {
    let (limits, room) = (state.volume_limits(), state.room());
    for (number, argument) in volumes.iter().enumerate() {
        let failed = || format!("cannot load {argument}");
        let request = LoadRequest::from_argument(argument).with_context(failed)?;
        let place = state.volumes.reserve(request.source.default_name(), request.to_json(), Waiting::Asker)?;
        let loading = place.loading().clone();
        let prepared = tokio::task::spawn_blocking(move || request.prepare_for(&loading, &limits, &room));
        let entry = place.fill(prepared.await?.with_context(failed)?).await.with_context(failed)?;
        let document = json!({ "volume": entry.id.0 });
        // The first scene has a name that can be written down.
        let scene = match number {
            0 => state.scenes.create_as(DEFAULT_SCENE.into(), &document)?,
            _ => state.scenes.create(&document)?,
        };
        tracing::info!(volume = entry.id.0, name = entry.name, scene = scene.id, "loaded");
    }
    Ok(())
}

/// Where the server is and what to try first.
fn announce(out: &mut dyn Write, state: &AppState, address: SocketAddr) -> std::io::Result<()> {
    writeln!(out, "Listening on http://{address}")?;
    // An unspecified address can be listened on but not opened in a browser.
    let reachable = match address.ip() {
        IpAddr::V4(ip) if ip.is_unspecified() => SocketAddr::new(Ipv4Addr::LOCALHOST.into(), address.port()),
        IpAddr::V6(ip) if ip.is_unspecified() => SocketAddr::new(Ipv6Addr::LOCALHOST.into(), address.port()),
        _ => address,
    };
    writeln!(out, "Viewer:  http://{reachable}/")?;
    let key = if state.keys.is_open() { "" } else { " -H \"Authorization: Bearer $KEY\"" };
    match state.scenes.list().first() {
        Some(scene) => {
            let id = scene.snapshot().id;
            writeln!(
                out,
                "Try:     curl{key} -o frame.png 'http://{reachable}/v1/scenes/{id}/frame?width=1024&height=768'"
            )?;
        }
        None => writeln!(
            out,
            "Try:     curl{key} -H 'Content-Type: application/json' \
             -d '{{\"source\":{{\"procedural\":{{\"kind\":\"gyroid\",\"dims\":[128,128,128]}}}}}}' http://{reachable}/v1/volumes"
        )?,
    }
    out.flush()
}

/// Ends when the renderer does: a server without one must be restarted, not kept.
async fn watch_renderer(state: &AppState) -> anyhow::Result<()> {
    while state.renderer.is_alive() {
        tokio::time::sleep(PULSE).await;
    }
    Err(anyhow!("the renderer is gone"))
}

/// Begins to listen for SIGTERM and SIGINT; what is returned waits for one of them.
fn stop_signal() -> anyhow::Result<impl Future<Output = &'static str>> {
    #[cfg(unix)]
    {
        use tokio::signal::unix::{SignalKind, signal};
        let (mut terminate, mut interrupt) = (signal(SignalKind::terminate())?, signal(SignalKind::interrupt())?);
        Ok(async move {
            tokio::select! {
                _ = terminate.recv() => "SIGTERM",
                _ = interrupt.recv() => "SIGINT",
            }
        })
    }
    #[cfg(not(unix))]
    {
        Ok(async {
            let _ = tokio::signal::ctrl_c().await;
            "ctrl-c"
        })
    }
}

/// Kept of the drain's deadline, to answer with what has come to an end.
const ANSWERS: Duration = Duration::from_secs(1);

/// Takes no new work, finishes what is in flight and ends the render thread, all within the deadline.
async fn drain(
    state: AppState,
    server: tokio::task::JoinHandle<std::io::Result<()>>,
    stop: oneshot::Sender<()>,
    thread: RenderThread,
    timeout: Duration,
) {
    let deadline = Instant::now() + timeout;
    let left = || deadline.saturating_duration_since(Instant::now());
    state.lifecycle.enter(Phase::Draining);
    // Nobody will ask for what nobody waits for.
    state.volumes.cancel_loads(Some(Waiting::Nobody));
    // The listener stays open until then, so that probes see why nothing is served.
    // The rest of the time is for the answers to those whose loads are called off.
    let idle = state.lifecycle.idle(left().saturating_sub(ANSWERS.min(timeout / 4))).await;
    state.volumes.cancel_loads(None);
    let _ = stop.send(());
    let abort = server.abort_handle();
    let closed = tokio::time::timeout(left(), server).await.is_ok();
    abort.abort();
    // The render thread ends with its last handle.
    drop(state);
    let wait = left();
    let joined = tokio::task::spawn_blocking(move || thread.join(wait)).await.unwrap_or(false);
    tracing::info!(idle, closed, renderer_ended = joined, "stopped");
}

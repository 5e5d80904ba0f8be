//! Every route and the order of the middleware: the one place to look when asking "what answers this?".

use axum::Router;
use axum::extract::{MatchedPath, Request, State};
use axum::http::{HeaderName, HeaderValue, Method, header};
use axum::middleware::{Next, from_fn, from_fn_with_state};
use axum::response::Response;
use axum::routing::{MethodRouter, get, post};
use tower::util::option_layer;
use tower_http::catch_panic::CatchPanicLayer;
use tower_http::cors::{AllowOrigin, CorsLayer};

use super::{
    AppState, ao, auth, envelope, files, frames, metrics, pages, presets, scenes, server, stream, uploads, viewer,
    volumes, voxels,
};
use crate::error::{ApiError, ErrorCode};

/// Paths that answer in every phase of the server's life.
const PROBES: [&str; 2] = ["/livez", "/readyz"];

/// The path whose time limit is its body's: see [`uploads`].
const UPLOAD: &str = "/v1/volumes";

/// Path, methods (HEAD comes with GET) and handlers.
fn routes() -> Vec<(&'static str, &'static str, MethodRouter<AppState>)> {
    vec![
        ("/v1/volumes", "GET POST", get(volumes::list).post(uploads::create)),
        ("/v1/volumes/{id}", "GET DELETE", get(volumes::show).delete(volumes::delete)),
        ("/v1/volumes/{id}/histogram", "GET", get(volumes::histogram)),
        ("/v1/volumes/{id}/slice", "GET", get(voxels::slice)),
        ("/v1/volumes/{id}/probe", "GET", get(voxels::probe)),
        ("/v1/volumes/{id}/data", "GET", get(voxels::data)),
        ("/v1/volumes/{id}/thumbnail", "GET", get(voxels::thumbnail)),
        ("/v1/volumes/{id}/metadata", "GET", get(volumes::metadata)),
        ("/v1/files", "GET", get(files::list)),
        ("/v1/scenes", "GET POST", get(scenes::list).post(scenes::create)),
        (
            "/v1/scenes/{id}",
            "GET PUT PATCH DELETE",
            get(scenes::show).put(scenes::replace).patch(scenes::patch).delete(scenes::delete),
        ),
        ("/v1/scenes/{id}/undo", "POST", post(scenes::undo)),
        ("/v1/scenes/{id}/redo", "POST", post(scenes::redo)),
        ("/v1/scenes/{id}/frame", "GET", get(frames::of_scene)),
        ("/v1/scenes/{id}/ao", "GET", get(ao::download)),
        ("/v1/scenes/{id}/stream", "GET", get(stream::open)),
        ("/v1/render", "POST", post(frames::one_shot)),
        ("/v1/presets", "GET", get(presets::list)),
        ("/v1/presets/{id}/thumbnail", "GET", get(presets::thumbnail)),
        ("/v1/server", "GET", get(server::show)),
        ("/metrics", "GET", get(metrics::show)),
        ("/livez", "GET", get(server::livez)),
        ("/readyz", "GET", get(server::readyz)),
        ("/openapi.json", "GET", get(pages::openapi)),
        ("/docs", "GET", get(pages::docs)),
        ("/", "GET", get(viewer::index)),
        ("/viewer/{*path}", "GET", get(viewer::file)),
    ]
}

/// Path (as OpenAPI writes it) and methods of every route, for comparison with the OpenAPI document.
pub fn route_table() -> Vec<(String, Vec<&'static str>)> {
    routes().into_iter().map(|(path, methods, _)| (path.replace("{*", "{"), methods.split(' ').collect())).collect()
}

/// The whole HTTP interface.
pub fn router(state: AppState) -> Router {
    let routed = routes().into_iter().fold(Router::new(), |router, (path, _, handlers)| router.route(path, handlers));
    with_middleware(routed, state)
}

/// Routes behind everything that stands between them and a client.
pub fn with_middleware(routed: Router<AppState>, state: AppState) -> Router {
    // Read from below: the last layer is the outermost, first to see a request and last to see its answer.
    routed
        .fallback(async || ApiError::new(ErrorCode::NotFound, "there is no such route"))
        .layer(from_fn_with_state(state.clone(), time_limit))
        .layer(from_fn_with_state(state.clone(), gate))
        .layer(from_fn_with_state(state.clone(), auth::require_key))
        .layer(from_fn_with_state(state.clone(), auth::refuse_foreign_pages))
        .layer(CatchPanicLayer::custom(envelope::from_panic))
        // Outside of the keys: a browser asks whether it may call before it sends one.
        .layer(option_layer(cors(&state.allow_origins)))
        .layer(from_fn(envelope::observe))
        .with_state(state)
}

/// Refuses work while the server starts or drains, and counts what it lets in.
async fn gate(State(state): State<AppState>, request: Request, next: Next) -> Result<Response, ApiError> {
    if PROBES.contains(&request.uri().path()) {
        return Ok(next.run(request).await);
    }
    let _counted = state.lifecycle.count_request();
    state.ready()?;
    Ok(next.run(request).await)
}

/// Ends requests that take too long. Dropping the handler also drops its job: the renderer skips it.
async fn time_limit(State(state): State<AppState>, request: Request, next: Next) -> Result<Response, ApiError> {
    let is_upload = request.method() == Method::POST
        && request.extensions().get::<MatchedPath>().is_some_and(|path| path.as_str() == UPLOAD);
    if is_upload {
        return Ok(next.run(request).await);
    }
    let limit = state.limits.request_timeout;
    tokio::time::timeout(limit, next.run(request))
        .await
        .map_err(|_| ApiError::new(ErrorCode::Timeout, format!("this took longer than {} s", limit.as_secs_f64())))
}

/// Lets pages of the allowed origins call; without any, browsers keep other pages out by themselves.
fn cors(allow_origins: &[String]) -> Option<CorsLayer> {
    if allow_origins.is_empty() {
        return None;
    }
    let origins = if allow_origins.iter().any(|origin| origin == "*") {
        AllowOrigin::any()
    } else {
        AllowOrigin::list(allow_origins.iter().filter_map(|origin| HeaderValue::from_str(origin).ok()))
    };
    let layer = CorsLayer::new()
        .allow_origin(origins)
        .allow_methods([Method::GET, Method::POST, Method::PUT, Method::PATCH, Method::DELETE])
        .allow_headers([
            header::AUTHORIZATION,
            header::CONTENT_TYPE,
            header::IF_MATCH,
            HeaderName::from_static("x-request-id"),
        ])
        .expose_headers([
            header::ETAG,
            header::LOCATION,
            header::RETRY_AFTER,
            HeaderName::from_static("server-timing"),
            HeaderName::from_static("x-ao-grid"),
            HeaderName::from_static("x-request-id"),
            HeaderName::from_static("x-scene-revision"),
            voxels::ORIENTATION,
            voxels::PIXEL_SIZE,
            voxels::SLICE_INDEX,
            voxels::WINDOW,
        ]);
    Some(layer)
}

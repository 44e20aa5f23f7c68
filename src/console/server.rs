//! Routes and headers.

use crate::access::{Access, Role};
use crate::assets::{ASSETS, Asset};
use crate::hub::Hub;
use crate::measurement::FileKind;
use crate::{upload, viewer};
use axum::Router;
use axum::body::Body;
use axum::extract::ws::rejection::WebSocketUpgradeRejection;
use axum::extract::{Path, Query, Request, State, WebSocketUpgrade};
use axum::http::{HeaderMap, HeaderName, HeaderValue, StatusCode, Uri, header};
use axum::middleware::{Next, from_fn_with_state};
use axum::response::{IntoResponse, Response};
use axum::routing::{get, post};
use std::sync::Arc;

/// Maximum size of a message from a viewer in bytes.
const MAX_MESSAGE: usize = 64 << 10;
/// Content security policy: the page loads files from this server only, and cannot be embedded in
/// another page.
const POLICY: &str =
    "default-src 'self'; frame-ancestors 'none'; base-uri 'none'; form-action 'none'";
/// Headers of every response.
const HEADERS: [(HeaderName, &str); 5] = [
    (header::CONTENT_SECURITY_POLICY, POLICY),
    (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
    // Do not pass the page's address on to other sites: it contains the token.
    (header::REFERRER_POLICY, "no-referrer"),
    (header::CACHE_CONTROL, "no-store"),
    (
        HeaderName::from_static("cross-origin-resource-policy"),
        "same-origin",
    ),
];

/// Answer to a request that a page of another site has sent.
const NOT_OURS: &str = "Only the console's own page may open this.\n";

#[derive(Clone)]
struct Shared {
    access: Arc<Access>,
    hub: Arc<Hub>,
}

/// Returns the router with all addresses of a console.
pub(crate) fn routes(access: Arc<Access>, hub: Arc<Hub>) -> Router {
    let shared = Shared { access, hub };
    Router::new()
        .route("/", get(page))
        .route("/ws", get(socket))
        .route("/recordings/{name}", post(receive))
        .route("/scans/{source}/{name}", get(scan))
        .route("/{*name}", get(asset))
        .layer(from_fn_with_state(shared.clone(), guard))
        .with_state(shared)
}

fn text(headers: &HeaderMap, name: HeaderName) -> &str {
    let value = headers.get(name).and_then(|value| value.to_str().ok());
    value.unwrap_or_default()
}

/// Returns the role of the token in the address of a request.
fn role(access: &Access, uri: &Uri) -> Option<Role> {
    let Query(pairs) = Query::<Vec<(String, String)>>::try_from_uri(uri).ok()?;
    let token = pairs.iter().find(|(key, _)| key == "token")?;
    access.role_of(&token.1)
}

/// Refuses requests that name another host, or that have neither our cookie nor, for the page, a token.
async fn guard(State(shared): State<Shared>, request: Request, next: Next) -> Response {
    let access = &shared.access;
    let headers = request.headers();
    let cookies = headers.get_all(header::COOKIE).iter();
    let known =
        { cookies }.any(|value| value.to_str().is_ok_and(|text| access.is_our_cookie(text)));
    let admitted = request.uri().path() == "/" && role(access, request.uri()).is_some();
    let mut response = if !access.is_our_host(text(headers, header::HOST)) {
        let why = "This console is reached as 127.0.0.1 or localhost, with its port.\n";
        (StatusCode::MISDIRECTED_REQUEST, why).into_response()
    } else if known || admitted {
        next.run(request).await
    } else {
        let why = "Open the address that the console has printed, with its token. It is new \
                   each time the console starts.\n";
        (StatusCode::FORBIDDEN, why).into_response()
    };
    if admitted && let Ok(cookie) = HeaderValue::from_str(&access.cookie()) {
        response.headers_mut().insert(header::SET_COOKIE, cookie);
    }
    for (name, value) in HEADERS {
        let headers = response.headers_mut();
        headers.insert(name, HeaderValue::from_static(value));
    }
    response
}

fn file(asset: &'static Asset) -> Response {
    (
        [(header::CONTENT_TYPE, asset.kind)],
        Body::from(asset.bytes),
    )
        .into_response()
}

async fn page() -> Response {
    file(&ASSETS[0])
}

async fn asset(Path(name): Path<String>) -> Response {
    match ASSETS.iter().find(|asset| asset.name == name) {
        Some(asset) => file(asset),
        None => StatusCode::NOT_FOUND.into_response(),
    }
}

/// Sends the last measurement of a source as a file.
async fn scan(
    State(shared): State<Shared>,
    Path((source, name)): Path<(usize, String)>,
    uri: Uri,
) -> Response {
    if role(&shared.access, &uri).is_none() {
        return (StatusCode::FORBIDDEN, "This needs a token.\n").into_response();
    }
    let Some(kind) = FileKind::of_name(&name) else {
        return StatusCode::NOT_FOUND.into_response();
    };
    let Some(measurement) = shared.hub.measurement(source) else {
        return (StatusCode::NOT_FOUND, "There is no scan yet.\n").into_response();
    };
    let file = tokio::task::spawn_blocking(move || measurement.file(kind));
    match file.await {
        Ok(Ok(bytes)) => {
            let attached = format!("attachment; filename=\"{name}\"");
            let headers = [
                (header::CONTENT_TYPE, "application/octet-stream".to_owned()),
                (header::CONTENT_DISPOSITION, attached),
            ];
            (headers, bytes).into_response()
        }
        Ok(Err(why)) => (StatusCode::CONFLICT, format!("{why}\n")).into_response(),
        Err(_) => StatusCode::INTERNAL_SERVER_ERROR.into_response(),
    }
}

/// Stores a recording that a viewer uploads.
async fn receive(
    State(shared): State<Shared>,
    Path(name): Path<String>,
    headers: HeaderMap,
    uri: Uri,
    body: Body,
) -> Response {
    let access = &shared.access;
    let host = text(&headers, header::HOST);
    if role(access, &uri) != Some(Role::Control) {
        let why = "Only those who may control the scanner may send recordings.\n";
        return (StatusCode::FORBIDDEN, why).into_response();
    }
    if !access.is_our_origin(text(&headers, header::ORIGIN), host) {
        return (StatusCode::FORBIDDEN, NOT_OURS).into_response();
    }
    let Some(folder) = shared.hub.recordings() else {
        let why = "This console has no folder for recordings.\n";
        return (StatusCode::NOT_FOUND, why).into_response();
    };
    match upload::store(folder, &name, body).await {
        Ok(()) => StatusCode::NO_CONTENT.into_response(),
        Err(refusal) => refusal.into_response(),
    }
}

/// Opens the WebSocket of a viewer. A request without an upgrade to a WebSocket only tests whether there
/// are too many viewers.
async fn socket(
    State(shared): State<Shared>,
    headers: HeaderMap,
    uri: Uri,
    upgrade: Result<WebSocketUpgrade, WebSocketUpgradeRejection>,
) -> Response {
    let Some(role) = role(&shared.access, &uri) else {
        return (StatusCode::FORBIDDEN, "This needs a token.\n").into_response();
    };
    let may_control = role == Role::Control;
    let full = (
        StatusCode::SERVICE_UNAVAILABLE,
        "There are too many viewers.\n",
    );
    let upgrade = match upgrade {
        Ok(upgrade) => upgrade,
        Err(_) if shared.hub.is_full(may_control) => return full.into_response(),
        Err(plain) => return plain.into_response(),
    };
    let host = text(&headers, header::HOST);
    if !shared
        .access
        .is_our_origin(text(&headers, header::ORIGIN), host)
    {
        return (StatusCode::FORBIDDEN, NOT_OURS).into_response();
    }
    let Some(seat) = shared.hub.enter(may_control) else {
        return full.into_response();
    };
    let upgrade = upgrade
        .max_message_size(MAX_MESSAGE)
        .max_frame_size(MAX_MESSAGE);
    upgrade.on_upgrade(|socket| viewer::serve(socket, seat))
}

//! Routes and headers.

use crate::access::{Access, Role};
use crate::assets::{ASSETS, Asset};
use crate::hub::Hub;
use crate::viewer;
use axum::Router;
use axum::body::Body;
use axum::extract::{Path, Query, Request, State, WebSocketUpgrade};
use axum::http::{HeaderMap, HeaderName, HeaderValue, StatusCode, header};
use axum::middleware::{Next, from_fn_with_state};
use axum::response::{IntoResponse, Response};
use axum::routing::get;
use std::sync::Arc;

/// Maximum size of a message from a viewer in bytes.
const MAX_MESSAGE: usize = 64 << 10;
/// The page loads nothing from elsewhere and is shown in no other page.
const POLICY: &str =
    "default-src 'self'; frame-ancestors 'none'; base-uri 'none'; form-action 'none'";
/// Headers of every response.
const HEADERS: [(HeaderName, &str); 5] = [
    (header::CONTENT_SECURITY_POLICY, POLICY),
    (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
    // The address of the first request has the token.
    (header::REFERRER_POLICY, "no-referrer"),
    (header::CACHE_CONTROL, "no-store"),
    (
        HeaderName::from_static("cross-origin-resource-policy"),
        "same-origin",
    ),
];

#[derive(Clone)]
struct Shared {
    access: Arc<Access>,
    hub: Arc<Hub>,
}

/// Returns the pages of a console.
pub(crate) fn routes(access: Arc<Access>, hub: Arc<Hub>) -> Router {
    let shared = Shared { access, hub };
    Router::new()
        .route("/", get(page))
        .route("/ws", get(socket))
        .route("/{name}", get(asset))
        .layer(from_fn_with_state(shared.clone(), guard))
        .with_state(shared)
}

fn text(headers: &HeaderMap, name: HeaderName) -> &str {
    let value = headers.get(name).and_then(|value| value.to_str().ok());
    value.unwrap_or_default()
}

/// Refuses requests that name another host or have no token of ours.
async fn guard(State(shared): State<Shared>, mut request: Request, next: Next) -> Response {
    let headers = request.headers();
    let host = text(headers, header::HOST);
    let mut response = if !shared.access.is_our_host(host) {
        let why = "This console is reached as 127.0.0.1 or localhost, with its port.\n";
        (StatusCode::MISDIRECTED_REQUEST, why).into_response()
    } else {
        let cookies = headers.get_all(header::COOKIE).iter();
        let roles = cookies.filter_map(|value| shared.access.role_of_cookies(value.to_str().ok()?));
        let kept = roles.max();
        let query = Query::<Vec<(String, String)>>::try_from_uri(request.uri());
        let pairs = query.map(|Query(pairs)| pairs).unwrap_or_default();
        let mut tokens = pairs.iter().filter(|(key, _)| key == "token");
        let given = match tokens.next() {
            Some((_, token)) if request.uri().path() == "/" => shared.access.role_of(token),
            _ => None,
        };
        // The address to view does not take control from a browser that has it.
        match kept.max(given) {
            Some(role) => {
                request.extensions_mut().insert(role);
                let mut response = next.run(request).await;
                if given.is_some()
                    && let Ok(cookie) = HeaderValue::from_str(&shared.access.cookie(role))
                {
                    response.headers_mut().insert(header::SET_COOKIE, cookie);
                }
                response
            }
            None => {
                let why = "Open the address that the console has printed, with its token. It is new \
                           each time the console starts.\n";
                (StatusCode::FORBIDDEN, why).into_response()
            }
        }
    };
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

/// Opens the WebSocket of a viewer.
async fn socket(
    State(shared): State<Shared>,
    headers: HeaderMap,
    axum::Extension(role): axum::Extension<Role>,
    upgrade: WebSocketUpgrade,
) -> Response {
    let host = text(&headers, header::HOST);
    if !shared
        .access
        .is_our_origin(text(&headers, header::ORIGIN), host)
    {
        let why = "Only the console's own page may open this.\n";
        return (StatusCode::FORBIDDEN, why).into_response();
    }
    let Some(seat) = shared.hub.enter(role == Role::Control) else {
        let why = "There are too many viewers.\n";
        return (StatusCode::SERVICE_UNAVAILABLE, why).into_response();
    };
    let upgrade = upgrade.max_message_size(MAX_MESSAGE);
    upgrade.on_upgrade(|socket| viewer::serve(socket, seat))
}

//! Access to the page and to control of the scanner.
//!
//! The page is served on the loopback interface, which other users of the machine and pages of
//! other sites can reach as well. Three random secrets keep them out. The page's address contains a
//! token, either to view or to control; the page keeps the token for its tab and presents it when
//! it opens the WebSocket. With the first request the browser gets a cookie (`SameSite=Strict`);
//! without it, later requests are refused. The cookie gives access to the page's files only,
//! because browsers send a host's cookies to other ports of this machine too. The check of `Host`
//! rejects names of other sites that resolve to this machine (DNS rebinding); the check of `Origin`
//! rejects WebSockets that pages of other sites open.

use phasmid_core::error::{Error, Result};
use phasmid_protocol::admission::Token;

/// The rights of a viewer.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Role {
    View,
    Control,
}

/// The tokens of a console.
pub(crate) struct Access {
    port: u16,
    view: Token,
    control: Token,
    cookie: Token,
}

impl Access {
    /// Creates random tokens for a console on this port.
    ///
    /// # Errors
    /// Returns an error if the system has no random numbers.
    pub(crate) fn new(port: u16) -> Result<Self> {
        let draw = || {
            let mut random = [0; 16];
            getrandom::fill(&mut random).map_err(|e| Error::device(format!("a token: {e}")))?;
            let hex: String = random.iter().map(|byte| format!("{byte:02x}")).collect();
            Token::parse(hex.as_bytes()).map_err(Error::device)
        };
        Ok(Self {
            port,
            view: draw()?,
            control: draw()?,
            cookie: draw()?,
        })
    }

    /// Returns the address of the page whose token gives this role.
    pub(crate) fn url(&self, role: Role) -> String {
        let token = self.token(role).to_line();
        format!("http://127.0.0.1:{}/?token={}", self.port, token.trim_end())
    }

    /// Returns the token with which other people can watch.
    pub(crate) fn view_token(&self) -> String {
        self.view.to_line().trim_end().to_owned()
    }

    fn token(&self, role: Role) -> &Token {
        match role {
            Role::View => &self.view,
            Role::Control => &self.control,
        }
    }

    /// Returns the role that a token gives.
    pub(crate) fn role_of(&self, token: &str) -> Option<Role> {
        let roles = [Role::Control, Role::View].into_iter();
        { roles }.find(|role| self.token(*role).matches(token.as_bytes()))
    }

    /// Returns whether the cookies of a request include this console's cookie.
    pub(crate) fn is_our_cookie(&self, cookies: &str) -> bool {
        let name = self.cookie_name();
        let pairs = cookies.split(';');
        let mut pairs = pairs.filter_map(|pair| pair.trim().split_once('='));
        pairs.any(|(key, value)| key == name && self.cookie.matches(value.as_bytes()))
    }

    /// Returns the cookie's name, which contains the port because browsers send a host's cookies to
    /// all ports.
    fn cookie_name(&self) -> String {
        format!("phasmid-{}", self.port)
    }

    /// Returns the value of the `Set-Cookie` header for this console's cookie.
    pub(crate) fn cookie(&self) -> String {
        let (name, value) = (self.cookie_name(), self.cookie.to_line());
        format!(
            "{name}={}; Path=/; HttpOnly; SameSite=Strict",
            value.trim_end()
        )
    }

    /// Returns whether a request names this machine's loopback interface, and no other site, as its
    /// host.
    pub(crate) fn is_our_host(&self, host: &str) -> bool {
        // Browsers leave the default port out.
        let name = host.strip_suffix(&format!(":{}", self.port));
        let name = name.or_else(|| (self.port == 80).then_some(host));
        name.is_some_and(|name| matches!(name, "127.0.0.1" | "localhost"))
    }

    /// Returns whether a request comes from the page itself.
    pub(crate) fn is_our_origin(&self, origin: &str, host: &str) -> bool {
        self.is_our_host(host) && origin.strip_prefix("http://") == Some(host)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tokens_give_their_role_and_the_cookie_none() {
        let access = Access::new(8080).unwrap();
        let other = Access::new(8080).unwrap();
        for role in [Role::View, Role::Control] {
            let url = access.url(role);
            let token = url.strip_prefix("http://127.0.0.1:8080/?token=").unwrap();
            assert_eq!(token.len(), 32);
            assert_eq!(access.role_of(token), Some(role));
            assert_eq!(access.role_of(&token[1..]), None);
            assert_eq!(other.role_of(token), None);
            assert!(!access.is_our_cookie(&format!("phasmid-8080={token}")));
        }
        let cookie = access.cookie();
        let pair = cookie.split(';').next().unwrap();
        assert!(access.is_our_cookie(pair) && access.is_our_cookie(&format!("a=b; {pair}; c")));
        assert!(!access.is_our_cookie(&format!("x{pair}")) && !other.is_our_cookie(pair));
        assert_eq!(access.role_of(pair.split_once('=').unwrap().1), None);
        assert_eq!(access.role_of(""), None);
        assert!(!access.is_our_cookie(""));
    }

    #[test]
    fn foreign_hosts_and_origins_are_not_ours() {
        let access = Access::new(8080).unwrap();
        for host in ["127.0.0.1:8080", "localhost:8080"] {
            assert!(access.is_our_host(host));
            assert!(access.is_our_origin(&format!("http://{host}"), host));
        }
        for host in [
            "evil.example:8080",
            "127.0.0.1",
            "127.0.0.1:80",
            "127.0.0.1:8080.evil.example",
            "localhost:80800",
            "",
        ] {
            assert!(!access.is_our_host(host), "{host}");
            assert!(!access.is_our_origin(&format!("http://{host}"), host));
        }
        for origin in [
            "http://evil.example",
            "http://localhost:8080",
            "https://127.0.0.1:8080",
            "null",
            "",
        ] {
            assert!(!access.is_our_origin(origin, "127.0.0.1:8080"), "{origin}");
        }
        let default = Access::new(80).unwrap();
        assert!(default.is_our_host("localhost") && default.is_our_host("127.0.0.1:80"));
        assert!(!default.is_our_host("evil.example"));
    }
}

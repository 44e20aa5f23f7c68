//! Who may see the page and who may control the scanner.
//!
//! The page is served on the loopback interface, which other users of the machine and pages of other
//! sites can reach as well. Two random tokens keep them out: one to view, one to control. A token is
//! given once, in the address, and comes back as a cookie that only this page's own requests carry
//! (`SameSite=Strict`). A name of another site that resolves to this machine (DNS rebinding) fails at
//! the check of `Host`, a WebSocket opened by a page of another site at the check of `Origin`.

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
}

impl Access {
    /// Draws the tokens for a console on this port.
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
        })
    }

    /// Returns the address that gives this role.
    pub(crate) fn url(&self, role: Role) -> String {
        let token = self.token(role).to_line();
        format!("http://127.0.0.1:{}/?token={}", self.port, token.trim_end())
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

    /// Returns the role that the cookies of a request give.
    pub(crate) fn role_of_cookies(&self, cookies: &str) -> Option<Role> {
        let name = self.cookie_name();
        let pairs = cookies
            .split(';')
            .filter_map(|pair| pair.trim().split_once('='));
        let ours = pairs.filter(|(key, _)| *key == name);
        ours.filter_map(|(_, token)| self.role_of(token)).max()
    }

    /// Cookies do not distinguish ports, so the name does.
    fn cookie_name(&self) -> String {
        format!("phasmid-{}", self.port)
    }

    /// Returns the cookie that keeps a role.
    pub(crate) fn cookie(&self, role: Role) -> String {
        let token = self.token(role).to_line();
        format!(
            "{}={}; Path=/; HttpOnly; SameSite=Strict",
            self.cookie_name(),
            token.trim_end()
        )
    }

    /// Returns whether a request names this machine's loopback interface, and no other site, as its
    /// host.
    pub(crate) fn is_our_host(&self, host: &str) -> bool {
        let name = host.strip_suffix(&format!(":{}", self.port));
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
    fn tokens_and_cookies_give_their_role_and_no_other() {
        let access = Access::new(8080).unwrap();
        let other = Access::new(8080).unwrap();
        for role in [Role::View, Role::Control] {
            let url = access.url(role);
            let token = url.strip_prefix("http://127.0.0.1:8080/?token=").unwrap();
            assert_eq!(token.len(), 32);
            assert_eq!(access.role_of(token), Some(role));
            assert_eq!(access.role_of(&token[1..]), None);
            assert_eq!(other.role_of(token), None);
            let cookie = access.cookie(role);
            let pair = cookie.split(';').next().unwrap();
            assert_eq!(access.role_of_cookies(pair), Some(role));
            assert_eq!(
                access.role_of_cookies(&format!("a=b; {pair}; c")),
                Some(role)
            );
            assert_eq!(access.role_of_cookies(&format!("x{pair}")), None);
            assert_eq!(other.role_of_cookies(pair), None);
        }
        assert_eq!(access.role_of(""), None);
        assert_eq!(access.role_of_cookies(""), None);
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
    }
}

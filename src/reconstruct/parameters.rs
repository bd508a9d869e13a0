//! Parameters written `name=value,name=value`.

use std::str::FromStr;

use super::Method;
use crate::error::{Error, Result};

/// A method's parameters, all of them known to it.
pub struct Parameters {
    method: &'static str,
    values: Vec<(&'static str, String)>,
}

impl Parameters {
    /// Splits a text and fills in defaults.
    pub fn parse(method: &Method, text: &str) -> Result<Self> {
        let mut values: Vec<_> = method.parameters.iter().map(|p| (p.name, p.default.to_owned())).collect();
        for part in text.split(',').filter(|part| !part.is_empty()) {
            let (name, value) = part
                .split_once('=')
                .ok_or_else(|| Error::Usage(format!("`{part}` in method `{}` is not like name=value", method.id)))?;
            let slot = values.iter_mut().find(|(known, _)| *known == name).ok_or_else(|| {
                let names: Vec<_> = method.parameters.iter().map(|p| p.name).collect();
                let there = if names.is_empty() { "none".into() } else { names.join(", ") };
                Error::Usage(format!("method `{}` has no parameter `{name}`; it has {there}", method.id))
            })?;
            slot.1 = value.to_owned();
        }
        Ok(Self { method: method.id, values })
    }

    /// A value that `accept` takes; `range` says which ones it does.
    pub fn get<T: FromStr>(&self, name: &str, range: &str, accept: impl Fn(&T) -> bool) -> Result<T> {
        let text = self.values.iter().find(|(known, _)| *known == name).map_or("", |(_, value)| value);
        text.parse().ok().filter(accept).ok_or_else(|| {
            Error::Usage(format!("parameter `{name}` of method `{}` is `{text}`; it must be {range}", self.method))
        })
    }

    /// A value that is `on` or `off`.
    pub fn switch(&self, name: &str) -> Result<bool> {
        Ok(self.choice(name, &["on", "off"])? == "on")
    }

    /// A value out of a few.
    pub fn choice(&self, name: &str, choices: &[&str]) -> Result<String> {
        self.get(name, &choices.join(" or "), |text: &String| choices.contains(&text.as_str()))
    }
}

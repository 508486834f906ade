//! What the program remembers from run to run.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::unknown::unknown_fields;

/// Files kept in the list of recent ones.
const MAX_RECENT: usize = 12;

/// Everything that is remembered. Panes are named as by `Pane::name`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Settings {
    pub(crate) recent: Vec<PathBuf>,
    /// `None` follows the system.
    pub(crate) dark: Option<bool>,
    pub(crate) zoom: f32,
    /// Whether the menu, the panel at the side and the status line are shown.
    pub(crate) panels: bool,
    /// The view that has the window to itself; `None` for the overview.
    pub(crate) view: Option<String>,
    /// The view that the overview shows where there is no room for all of them; `None` for the first.
    pub(crate) tab: Option<String>,
    /// Whether open files of measurements are read again when they change.
    pub(crate) watch: bool,
    /// Whether the hint of the first run is shown.
    pub(crate) hint: bool,
    /// What each pane remembers, by the name of the pane.
    pub(crate) panes: BTreeMap<String, serde_json::Value>,
    /// What the user should know about how the settings were read.
    #[serde(skip)]
    pub(crate) notices: Vec<String>,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            recent: Vec::new(),
            dark: Some(true),
            zoom: 1.0,
            panels: true,
            view: None,
            tab: None,
            watch: true,
            hint: true,
            panes: BTreeMap::new(),
            notices: Vec::new(),
        }
    }
}

impl Settings {
    /// The settings that are kept under `key`: as JSON, or as earlier versions kept them. Fields that are not known,
    /// and settings that cannot be read, are among the notices.
    pub(crate) fn load(storage: &dyn eframe::Storage, key: &str) -> Self {
        let Some(text) = storage.get_string(key) else { return Self::default() };
        let damaged = |error: &dyn std::fmt::Display| Self {
            notices: vec![format!(
                "the settings of the last run cannot be read, and are as at first: {error}"
            )],
            ..Self::default()
        };
        if !text.trim_start().starts_with('{') {
            return eframe::get_value(storage, key).unwrap_or_else(|| damaged(&"they are no JSON"));
        }
        let read =
            serde_json::from_str::<Value>(&text).and_then(|given| Ok((Self::deserialize(&given)?, given)));
        match read {
            Ok((mut settings, given)) => {
                let known = serde_json::to_value(&settings).unwrap_or_default();
                let unknown = unknown_fields(&given, &known);
                settings.notices.extend(unknown.map(|names| format!("settings: {names}")));
                settings
            }
            Err(error) => damaged(&error),
        }
    }

    /// Keeps the settings under `key`.
    pub(crate) fn store(&self, storage: &mut dyn eframe::Storage, key: &str) {
        // Settings are plain data, which is always JSON.
        if let Ok(text) = serde_json::to_string(self) {
            storage.set_string(key, text);
        }
    }

    /// Puts a file at the head of the recent ones.
    pub(crate) fn remember(&mut self, path: &Path) {
        self.recent.retain(|p| p != path);
        self.recent.insert(0, path.to_owned());
        self.recent.truncate(MAX_RECENT);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::viewer::state::look::{SceneLook, SliceLook};
    use std::collections::HashMap;

    #[test]
    fn settings_come_back_and_what_is_missing_is_as_at_first() {
        let mut settings = Settings { zoom: 1.25, dark: Some(false), ..Settings::default() };
        let look = SliceLook { square_theta_h: true, ..SliceLook::default() };
        settings.panes.insert("slices".to_owned(), serde_json::to_value(look).unwrap());
        settings.remember(Path::new("a.binary"));
        let text = serde_json::to_string(&settings).unwrap();
        let found = serde_json::from_str::<Settings>(&text).unwrap();
        assert_eq!(found, settings);
        assert_eq!(serde_json::from_value::<SliceLook>(found.panes["slices"].clone()).unwrap(), look);
        let partial: Settings = serde_json::from_str("{\"zoom\": 2.0}").unwrap();
        assert_eq!(partial, Settings { zoom: 2.0, ..Settings::default() });
    }

    #[derive(Default)]
    struct Memory(HashMap<String, String>);

    impl eframe::Storage for Memory {
        fn get_string(&self, key: &str) -> Option<String> {
            self.0.get(key).cloned()
        }

        fn set_string(&mut self, key: &str, value: String) {
            self.0.insert(key.to_owned(), value);
        }

        fn remove_string(&mut self, key: &str) {
            self.0.remove(key);
        }

        fn flush(&mut self) {}
    }

    #[test]
    fn settings_survive_the_format_of_the_window_library() {
        let mut settings = Settings { view: Some("slices".to_owned()), ..Settings::default() };
        let shape = crate::viewer::state::look::Shape::File("a.obj".into());
        let look = SceneLook { shape, swipe: 0.3, ..SceneLook::default() };
        settings.panes.insert("3d".to_owned(), serde_json::to_value(&look).unwrap());
        let mut memory = Memory::default();
        eframe::set_value(&mut memory, "settings", &settings);
        let found = Settings::load(&memory, "settings");
        assert_eq!(found, settings);
        settings.store(&mut memory, "settings");
        assert_eq!(Settings::load(&memory, "settings"), settings);
        assert_eq!(serde_json::from_value::<SceneLook>(found.panes["3d"].clone()).unwrap(), look);
    }

    #[test]
    fn what_is_not_known_or_cannot_be_read_is_said() {
        let load = |text: &str| Settings::load(&Memory(HashMap::from([("s".into(), text.into())])), "s");
        let found = load("{\"zoom\": 2.0, \"night\": true}");
        assert_eq!(
            (found.zoom, found.notices),
            (2.0, vec!["settings: \"night\" not known, and ignored".to_owned()])
        );
        for text in ["{\"zoom\": \"large\"}", "{", "nonsense"] {
            let found = load(text);
            assert!(found.notices[0].contains("cannot be read"), "{text} {found:?}");
            assert_eq!(found.zoom, 1.0);
        }
        assert_eq!(Settings::load(&Memory::default(), "s"), Settings::default());
    }

    #[test]
    fn recent_files_are_few_and_the_newest_is_first() {
        let mut settings = Settings::default();
        for i in 0..20 {
            settings.remember(&PathBuf::from(format!("{i}.csv")));
        }
        settings.remember(Path::new("15.csv"));
        assert_eq!(settings.recent.len(), MAX_RECENT);
        assert_eq!(settings.recent[0], Path::new("15.csv"));
        assert_eq!(settings.recent.iter().filter(|p| *p == Path::new("15.csv")).count(), 1);
    }
}

//! How panes share the window.

use eframe::egui::{self, Rect, RichText, ScrollArea, Ui, UiBuilder, Vec2};

use super::pane::{Pane, PaneContext, Place, Share, Slot};
use super::shortcuts::OPEN;
use super::widgets::{narrow, segments_ui};
use crate::viewer::state::settings::Settings;

/// Room that all views need at once, and that one needs.
const ROOMY: Vec2 = egui::vec2(840.0, 560.0);
const LEAST: Vec2 = egui::vec2(360.0, 300.0);

/// Between the views of the overview.
const GAP: f32 = 14.0;

/// From this width of the window on the panel at the side is wide.
const WIDE: f32 = 1200.0;
/// Widths of the wide and of the narrow panel.
const SIDE: [f32; 2] = [320.0, 276.0];

/// All panes, with what they share.
pub(crate) struct Panes<'a> {
    pub(crate) list: &'a mut [Box<dyn Pane>],
    pub(crate) cx: &'a mut PaneContext,
    pub(crate) settings: &'a mut Settings,
}

/// The name and the title of each view.
pub(crate) fn views(panes: &[Box<dyn Pane>]) -> Vec<(&'static str, &'static str)> {
    let views = panes.iter().filter(|p| matches!(p.place(), Place::View(_)));
    views.map(|pane| (pane.name(), pane.title())).collect()
}

impl Panes<'_> {
    /// The panel at the side.
    pub(crate) fn side_ui(&mut self, ui: &mut Ui) {
        let width = SIDE[usize::from(ui.available_width() < WIDE)];
        egui::Panel::left("side").resizable(false).exact_size(width).show(ui, |ui| {
            ScrollArea::vertical().auto_shrink(false).show(ui, |ui| {
                for pane in self.list.iter_mut().filter(|p| p.place() == Place::Side) {
                    ui.push_id(pane.name(), |ui| pane.ui(ui, self.cx));
                }
            });
        });
    }

    /// The view that the user has chosen, or the overview.
    pub(crate) fn views_ui(&mut self, ui: &mut Ui) {
        if self.cx.documents.is_empty() {
            ui.centered_and_justified(|ui| {
                let keys = ui.ctx().format_shortcut(&OPEN);
                ui.label(RichText::new(format!("Drop a material here, or open one with {keys}")).size(18.0));
            });
            return;
        }
        let chosen = self.settings.view.as_deref();
        let view = self.list.iter().position(|p| p.place() != Place::Side && Some(p.name()) == chosen);
        if let Some(view) = view {
            self.single_ui(ui, view);
            return;
        }
        let room = ui.available_size();
        if room.x >= ROOMY.x && room.y >= ROOMY.y {
            self.overview_ui(ui);
        } else {
            self.tabs_ui(ui);
        }
    }

    /// The panes that share the overview, in the order of their slots.
    fn shares(&self) -> Vec<(Share, usize)> {
        let shares = self.list.iter().enumerate().filter_map(|(i, pane)| match pane.place() {
            Place::View(share) => share.map(|share| (share, i)),
            Place::Side => None,
        });
        let mut shares: Vec<_> = shares.collect();
        shares.sort_by_key(|(share, _)| share.slot);
        shares
    }

    /// Where the window is small or text is large: one view at a time, as large as there is room.
    fn tabs_ui(&mut self, ui: &mut Ui) {
        let shares = self.shares();
        let tabs: Vec<usize> = shares.iter().map(|(_, i)| *i).collect();
        let kept = self.settings.tab.as_deref();
        let kept = kept.and_then(|name| tabs.iter().copied().find(|&i| self.list[i].name() == name));
        let Some(mut tab) = kept.or(tabs.first().copied()) else { return };
        let title = |tab| shares.iter().find(|(_, i)| *i == tab).map_or("", |(share, _)| share.tab);
        if ui.horizontal(|ui| segments_ui(ui, &mut tab, &tabs, title)).inner {
            self.settings.tab = Some(self.list[tab].name().to_owned());
        }
        self.single_ui(ui, tab);
    }

    /// One view alone, with scroll bars where there is little room.
    fn single_ui(&mut self, ui: &mut Ui, view: usize) {
        let room = ui.available_size();
        if room.x >= LEAST.x && room.y >= LEAST.y {
            self.list[view].ui(ui, self.cx);
            return;
        }
        // The wheel zooms the view under it.
        let area = ScrollArea::both().scroll_source(egui::scroll_area::ScrollSource::SCROLL_BAR);
        area.auto_shrink(false).show(ui, |ui| {
            let size = room.max(LEAST) - Vec2::splat(12.0);
            let (rect, _) = ui.allocate_exact_size(size, egui::Sense::hover());
            ui.scope_builder(UiBuilder::new().max_rect(rect), |ui| self.list[view].ui(ui, self.cx));
        });
    }

    /// All views that have a share of the overview.
    fn overview_ui(&mut self, ui: &mut Ui) {
        let area = ui.available_rect_before_wrap();
        let shares = self.shares();
        for (slot, rect) in slots(area) {
            let here: Vec<usize> = shares.iter().filter(|(s, _)| s.slot == slot).map(|(_, i)| *i).collect();
            let count = narrow(here.len() as f64);
            let width = (rect.width() - GAP * (count - 1.0)) / count;
            for (k, i) in here.into_iter().enumerate() {
                let left = rect.left() + narrow(k as f64) * (width + GAP);
                let part =
                    Rect::from_min_size(egui::pos2(left, rect.top()), egui::vec2(width, rect.height()));
                let pane = &mut self.list[i];
                let builder = UiBuilder::new().max_rect(part).id_salt(pane.name());
                ui.scope_builder(builder, |ui| pane.ui(ui, self.cx));
            }
        }
    }
}

/// The slots of the overview in an area.
fn slots(area: Rect) -> [(Slot, Rect); 3] {
    // Below there is room for a row of four squares as wide as the window; the other two slots share the
    // rest.
    let below = (0.25 * area.width() + 36.0).min(area.height() * 0.46);
    let height = (area.height() - below - GAP).round();
    let width = (height * 0.92).min(area.width() * 0.42).round();
    let left = Rect::from_min_size(area.min, egui::vec2(width, height));
    let right = Rect::from_min_max(
        egui::pos2(left.right() + GAP, area.top()),
        egui::pos2(area.right(), left.bottom()),
    );
    let below = Rect::from_min_max(egui::pos2(area.left(), left.bottom() + GAP), area.max);
    [(Slot::Left, left), (Slot::Right, right), (Slot::Below, below)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slots_fill_the_overview_and_do_not_overlap() {
        for size in [[840.0, 560.0], [1440.0, 900.0], [3000.0, 700.0]] {
            let area = Rect::from_min_size(egui::pos2(10.0, 20.0), Vec2::from(size));
            let slots = slots(area);
            for (i, (_, rect)) in slots.iter().enumerate() {
                assert!(area.contains_rect(*rect) && rect.is_positive(), "{rect} in {area}");
                for (_, other) in &slots[..i] {
                    assert!(!rect.intersects(*other), "{rect} and {other}");
                }
            }
        }
    }
}

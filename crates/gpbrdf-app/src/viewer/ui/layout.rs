//! Where everything stands in the window.

use eframe::egui::{self, CentralPanel, Frame, Panel, RichText, Ui, Vec2};

use crate::viewer::app::Viewer;
use crate::viewer::state::settings::Arrangement;
use crate::viewer::ui::shortcuts::{self, Action};
use crate::viewer::ui::widgets::segments_ui;

/// Room that all views need at once, and that one needs.
const ROOMY: Vec2 = egui::vec2(840.0, 560.0);
const LEAST: Vec2 = egui::vec2(400.0, 300.0);

/// Width of the panel of materials and models, in windows of this width and in narrower ones.
const WIDE: f32 = 1200.0;
const PANEL: [f32; 2] = [320.0, 276.0];

impl Viewer {
    /// The whole window.
    pub(crate) fn window_ui(&mut self, ui: &mut Ui) {
        if self.settings.panels {
            Panel::top("menu").show(ui, |ui| self.menu_ui(ui));
        }
        self.messages.messages_ui(ui);
        if self.settings.panels {
            Panel::bottom("status").show(ui, |ui| self.status_ui(ui));
            let width = PANEL[usize::from(ui.available_width() < WIDE)];
            Panel::left("side").resizable(false).exact_size(width).show(ui, |ui| {
                egui::ScrollArea::vertical().auto_shrink(false).show(ui, |ui| {
                    self.materials_ui(ui);
                    self.model_ui(ui);
                });
            });
        }
        let frame = Frame::central_panel(ui.style()).inner_margin(10);
        CentralPanel::default().frame(frame).show(ui, |ui| self.views_ui(ui));
        let ctx = ui.ctx().clone();
        self.open_window_ui(&ctx);
        self.save_window_ui(&ctx);
        self.help_window_ui(&ctx);
    }

    fn views_ui(&mut self, ui: &mut Ui) {
        if self.documents.is_empty() {
            ui.centered_and_justified(|ui| {
                let keys = shortcuts::text(ui.ctx(), Action::Open);
                ui.label(RichText::new(format!("Drop a material here, or open one with {keys}")).size(18.0));
            });
            return;
        }
        let mut view = self.settings.arrangement;
        let there = ui.available_size();
        if view == Arrangement::All {
            if there.x >= ROOMY.x && there.y >= ROOMY.y {
                self.overview_ui(ui);
                return;
            }
            // Large text or a small window: one view at a time, as large as there is room.
            ui.horizontal(|ui| {
                let tabs = [Arrangement::Sphere, Arrangement::Plots, Arrangement::Slices];
                segments_ui(ui, &mut self.settings.tab, &tabs, |tab| match tab {
                    Arrangement::Sphere => "Material",
                    Arrangement::Plots => "Curves",
                    _ => "Images",
                });
            });
            view = self.settings.tab;
        }
        let there = ui.available_size();
        if there.x >= LEAST.x && there.y >= LEAST.y {
            self.view_ui(ui, view);
            return;
        }
        // The wheel zooms what is under it.
        let area = egui::ScrollArea::both().scroll_source(egui::scroll_area::ScrollSource::SCROLL_BAR);
        area.auto_shrink(false).show(ui, |ui| {
            let size = there.max(LEAST) - egui::Vec2::splat(12.0);
            let (rect, _) = ui.allocate_exact_size(size, egui::Sense::hover());
            ui.scope_builder(egui::UiBuilder::new().max_rect(rect), |ui| self.view_ui(ui, view));
        });
    }

    fn view_ui(&mut self, ui: &mut Ui, view: Arrangement) {
        match view {
            Arrangement::Slices => self.slices_ui(ui),
            Arrangement::Plots => self.plots_ui(ui),
            Arrangement::Sphere | Arrangement::All => self.sphere_ui(ui),
        }
    }

    /// All views at once.
    fn overview_ui(&mut self, ui: &mut Ui) {
        let area = ui.available_rect_before_wrap();
        // Four slices in a row take what their width allows; the rest is the sphere's and the plots'.
        let gap = 14.0;
        let slices = (0.25 * area.width() + 36.0).min(area.height() * 0.46);
        let split = (area.height() - slices - gap).round();
        let sphere_width = (split * 0.92).min(area.width() * 0.42).round();
        let top = egui::Rect::from_min_size(area.min, egui::vec2(sphere_width, split));
        let right = egui::Rect::from_min_max(
            egui::pos2(top.max.x + gap, area.min.y),
            egui::pos2(area.max.x, top.max.y),
        );
        let below = egui::Rect::from_min_max(egui::pos2(area.min.x, top.max.y + gap), area.max);
        let views = [Arrangement::Sphere, Arrangement::Plots, Arrangement::Slices];
        for (rect, view) in std::iter::zip([top, right, below], views) {
            let builder = egui::UiBuilder::new().max_rect(rect).id_salt(view.name());
            ui.scope_builder(builder, |ui| self.view_ui(ui, view));
        }
    }
}

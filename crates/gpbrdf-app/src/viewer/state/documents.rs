//! The list of open materials and which of them is selected.

use gpbrdf_core::Source;

use super::document::{Document, DocumentId};

/// The open materials, in the order in which they were opened.
#[derive(Debug, Default)]
pub(crate) struct Documents {
    list: Vec<Document>,
    selected: Option<DocumentId>,
    /// The only material that the plots draw, where there is one.
    solo: Option<DocumentId>,
    next_id: u64,
}

impl Documents {
    pub(crate) fn is_empty(&self) -> bool {
        self.list.is_empty()
    }

    pub(crate) fn iter(&self) -> impl Iterator<Item = &Document> {
        self.list.iter()
    }

    pub(crate) fn iter_mut(&mut self) -> impl Iterator<Item = &mut Document> {
        self.list.iter_mut()
    }

    pub(crate) fn get(&self, id: DocumentId) -> Option<&Document> {
        self.list.iter().find(|d| d.id == id)
    }

    pub(crate) fn get_mut(&mut self, id: DocumentId) -> Option<&mut Document> {
        self.list.iter_mut().find(|d| d.id == id)
    }

    /// The selected material.
    pub(crate) fn selected(&self) -> Option<&Document> {
        self.get(self.selected?)
    }

    pub(crate) fn selected_mut(&mut self) -> Option<&mut Document> {
        self.get_mut(self.selected?)
    }

    pub(crate) fn selected_id(&self) -> Option<DocumentId> {
        self.selected
    }

    pub(crate) fn select(&mut self, id: DocumentId) {
        self.selected = Some(id);
    }

    /// The only material that the plots draw, where there is one.
    pub(crate) fn solo(&self) -> Option<DocumentId> {
        self.solo
    }

    /// Lets the plots draw one material only, or all again if it was the only one already.
    pub(crate) fn toggle_solo(&mut self, id: DocumentId) {
        self.solo = if self.solo == Some(id) { None } else { Some(id) };
    }

    /// The materials that the plots draw.
    pub(crate) fn visible(&self) -> impl Iterator<Item = &Document> {
        self.list.iter().filter(|d| self.solo.map_or(d.visible, |solo| solo == d.id))
    }

    /// Opens a material and selects it.
    pub(crate) fn add(&mut self, source: Source) -> &mut Document {
        let id = DocumentId(self.next_id);
        self.next_id += 1;
        self.selected = Some(id);
        self.list.push(Document::new(id, source));
        let last = self.list.len() - 1;
        &mut self.list[last]
    }

    /// Closes a material. The last of the others is selected if it was selected.
    pub(crate) fn remove(&mut self, id: DocumentId) {
        self.list.retain(|d| d.id != id);
        self.solo = self.solo.filter(|solo| *solo != id);
        if self.selected == Some(id) {
            self.selected = self.list.last().map(|d| d.id);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_material_is_selected_as_long_as_any_is_open() {
        let mut documents = Documents::default();
        let mut open = |name: &str| documents.add(Source::built_in(name).unwrap()).id;
        let [ward, lambert] = ["ward", "lambert"].map(&mut open);
        assert_eq!(documents.selected_id(), Some(lambert));
        documents.toggle_solo(lambert);
        assert_eq!(documents.visible().map(|d| d.id).collect::<Vec<_>>(), [lambert]);
        documents.remove(lambert);
        assert_eq!((documents.selected_id(), documents.solo()), (Some(ward), None));
        assert_eq!(documents.visible().count(), 1);
        documents.remove(ward);
        assert!(documents.is_empty() && documents.selected().is_none());
    }
}

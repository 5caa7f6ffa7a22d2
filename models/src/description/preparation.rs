//! How the graphs that weights were trained on were built: what a description and its weights must agree on.
//!
//! Weights say it in their metadata under `preparation`, as a JSON object with the words of a description:
//!
//! ```text
//! {"kind":"knn","k":8,"candidates":"past","lifetime":"window","normalisation":"fixed","scales":[0.1,0.1176],
//!  "span_us":300000,"cells":[["1/8","1/8","1/3"]]}
//! ```
//!
//! `scales` are those of the edge attributes, level by level, and are missing with "per-graph"; `cells` are those of the
//! poolings. Weights may leave out `lifetime`: while no event leaves the window, both lifetimes give the same graph. The
//! published contact-angle checkpoint carries no metadata; it is recognised and has the preparation of the shipped network
//! `graphres-published`.
//!
//! A network is not built from weights that say otherwise than its description, unless that is asked for. Weights that say
//! nothing are taken as they are, and [`Description::agreement`] tells.

use meissner_engine::{Normalisation, Reach};
use serde_json::{Map, Value, json};

use super::frames::preparation::{KEY, normal};
use super::{Description, LayerKind};
use crate::{ModelError, Weights};

/// The network whose preparation the published checkpoint has.
const PUBLISHED: &str = "graphres-published";
/// The key that weights may leave out.
const LIFETIME: &str = "lifetime";

/// What weights say about the preparation of their training's input, compared with a description.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Agreement {
    /// The same as the description.
    Same,
    /// Nothing, for they were drawn from a seed.
    Drawn,
    /// Nothing.
    Unstated,
    /// Something else.
    Other,
}

impl Agreement {
    /// Its word in reports: "same", "drawn", "unstated" or "other".
    pub fn word(self) -> &'static str {
        match self {
            Self::Same => "same",
            Self::Drawn => "drawn",
            Self::Unstated => "unstated",
            Self::Other => "other",
        }
    }

    /// That of `weights` without a statement.
    pub(super) fn without_statement(weights: &Weights) -> Self {
        if weights.is_drawn() { Self::Drawn } else { Self::Unstated }
    }
}

impl Description {
    /// What weights that are trained for this description carry as metadata `preparation`: the rule of the graph, the scales
    /// of edge attributes, the span and the poolings' cells, as a JSON object.
    pub fn preparation(&self) -> String {
        let summary = self.graph_summary();
        let mut entries = vec![("kind", json!(summary.kind))];
        match self.graph.reach {
            Reach::Knn { k } => entries.push(("k", json!(k))),
            Reach::Radius { r, max } => entries.extend([("r", json!(r)), ("max", json!(max))]),
        }
        entries.push(("candidates", json!(summary.candidates)));
        entries.extend(summary.lifetime.map(|lifetime| (LIFETIME, json!(lifetime))));
        let (mut scales, mut cells) = (vec![self.scale.to_string()], Vec::new());
        for layer in &self.layers {
            if let LayerKind::Pool { cell, scale, .. } = &layer.kind {
                scales.push(scale.to_string());
                cells.push(cell.cell.iter().chain(&cell.time).map(ToString::to_string).collect::<Vec<_>>());
            }
        }
        let fixed = self.normalisation == Normalisation::Fixed;
        entries.push(("normalisation", json!(if fixed { "fixed" } else { "per-graph" })));
        let mut text: Vec<String> = entries.iter().map(|(key, value)| format!("{key:?}:{value}")).collect();
        if fixed {
            // The shortest digits of an f32, which those of the equal f64 are not.
            text.push(format!("\"scales\":[{}]", scales.join(",")));
        }
        text.push(format!("\"span_us\":{}", self.span_us));
        text.push(format!("\"cells\":{}", json!(cells)));
        format!("{{{}}}", text.join(","))
    }

    /// Whether `weights` were trained on graphs as this description builds them, by what they say.
    pub fn agreement(&self, weights: &Weights) -> Agreement {
        match stated(weights) {
            None => Agreement::without_statement(weights),
            Some(found) if self.says_the_same(&found) => Agreement::Same,
            Some(_) => Agreement::Other,
        }
    }

    /// `Ok` where `weights` do not say how their graphs were built, or say the same as this description.
    pub(super) fn check_preparation(&self, weights: &Weights) -> Result<(), ModelError> {
        if self.agreement(weights) != Agreement::Other {
            return Ok(());
        }
        Err(ModelError::Preparation {
            network: self.name.clone(),
            expected: self.preparation(),
            found: stated(weights).unwrap_or_default(),
            published: weights.is_published().then_some(PUBLISHED),
        })
    }

    fn says_the_same(&self, found: &str) -> bool {
        let read = |text: &str| serde_json::from_str::<Map<String, Value>>(text).ok().map(normal);
        let (Some(mut expected), Some(found)) = (read(&self.preparation()), read(found)) else {
            return false;
        };
        if !found.contains_key(LIFETIME) {
            expected.remove(LIFETIME);
        }
        expected == found
    }
}

/// The preparation that `weights` state, or that they are known to have.
fn stated(weights: &Weights) -> Option<String> {
    let known = || {
        let published = weights.is_published().then(|| Description::shipped(PUBLISHED)).flatten();
        published.map(|description| description.preparation())
    };
    weights.metadata().get(KEY).cloned().or_else(known)
}

#[cfg(test)]
mod tests {
    use super::{Agreement, KEY};
    use crate::{Description, ModelError, Weights, draw};

    fn shipped(name: &str) -> Description {
        Description::shipped(name).expect("shipped")
    }

    fn prepared(description: &Description, preparation: &str) -> Weights {
        draw(description, 1).with_metadata([(KEY.to_owned(), preparation.to_owned())].into())
    }

    #[test]
    fn the_preparation_of_an_event_network_has_the_words_of_its_file() {
        assert_eq!(
            shipped("digits-past").preparation(),
            r#"{"kind":"knn","k":8,"candidates":"past","lifetime":"window","normalisation":"fixed","scales":[0.1,0.1176],"span_us":300000,"cells":[["1/8","1/8","1/3"]]}"#
        );
        assert_eq!(
            shipped("graphres-published").preparation(),
            r#"{"kind":"knn","k":16,"candidates":"all","normalisation":"per-graph","span_us":150000,"cells":[["16/346","12/260"]]}"#
        );
    }

    #[test]
    fn weights_of_other_graphs_are_refused_and_taken_only_where_that_is_asked_for() {
        let graphres = shipped("graphres");
        let own = graphres.preparation();
        assert!(graphres.network(&prepared(&graphres, &own)).is_ok());
        for (from, to) in [
            ("\"k\":16", "\"k\":8"),
            ("\"all\"", "\"past\""),
            ("\"fixed\"", "\"per-graph\""),
            ("[0.5,0.4]", "[0.5,0.5]"),
            ("150000", "100000"),
            ("16/346", "1/8"),
            ("\"k\":16,", ""),
        ] {
            let found = own.replace(from, to);
            assert_ne!(found, own, "{from}");
            let weights = prepared(&graphres, &found);
            assert_eq!(graphres.agreement(&weights), Agreement::Other, "{found}");
            let error = graphres.network(&weights).expect_err(&found);
            assert!(matches!(&error, ModelError::Preparation { .. }), "{error}");
            assert!(error.to_string().contains(&found) && error.to_string().contains(&own), "{error}");
            assert!(graphres.network_regardless(&weights).is_ok());
        }
    }

    #[test]
    fn weights_that_say_nothing_are_taken_and_the_agreement_tells() {
        let graphres = shipped("graphres");
        let silent = Weights::new(draw(&graphres, 1).iter().map(|(name, t)| (name.to_owned(), t.clone())));
        assert_eq!(graphres.agreement(&silent), Agreement::Unstated);
        assert!(graphres.network(&silent).is_ok());
        let drawn = Weights::shipped("graphres").expect("shipped");
        assert_eq!(graphres.agreement(&drawn), Agreement::Drawn);
    }

    #[test]
    fn weights_without_a_lifetime_fit_both() {
        let (past, frozen) = (shipped("digits-past"), shipped("digits-frozen"));
        let without = past.preparation().replace("\"lifetime\":\"window\",", "");
        assert_eq!(past.agreement(&prepared(&past, &without)), Agreement::Same);
        assert_eq!(frozen.agreement(&prepared(&past, &without)), Agreement::Same);
        assert_eq!(frozen.agreement(&prepared(&past, &past.preparation())), Agreement::Other);
    }

    #[test]
    fn every_shipped_network_over_events_fits_its_weights() {
        for name in Description::shipped_names() {
            let weights = Weights::shipped(name).expect("shipped");
            let expected = if name.starts_with("digits") { Agreement::Same } else { Agreement::Drawn };
            assert_eq!(shipped(name).agreement(&weights), expected, "{name}");
            let card = weights.card().expect("a card");
            assert_eq!(card.trained, Some(name.starts_with("digits")), "{name}");
            assert_eq!(card.sensor.is_some(), name.starts_with("digits"), "{name}");
        }
    }
}

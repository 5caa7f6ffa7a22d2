//! Input that cannot be fitted to: a named error before any network runs.

use super::{Folder, Options, places};

/// Asserts that fitting to `folder` fails, with `expected` in the message.
fn refused(folder: &Folder, options: &Options, expected: &[&str]) {
    let error = folder.fit(options, 1).expect_err("it is refused").to_string();
    for part in expected {
        assert!(error.contains(part), "{part}: {error}");
    }
}

/// Presses with a row each.
fn rows(presses: usize, header: &str, row: impl Fn(usize) -> String) -> Folder {
    Folder::new(presses, header, |press, _, _| format!("press{press},{}", row(press)))
}

#[test]
fn fewer_than_two_presses_a_fold_are_refused() {
    let folder = rows(5, "recording,x_mm", |press| press.to_string());
    refused(
        &folder,
        &folder.options(),
        &["at least 6 presses with labels, two in each of 3 folds", "found 5"],
    );
}

#[test]
fn a_label_with_one_value_is_refused() {
    let folder = rows(6, "recording,x_mm,y_mm", |press| format!("{press},2.5"));
    refused(&folder, &folder.options(), &["different values of y", "2.5 in all presses"]);
    let chosen = Options { labels: Some(vec!["x".to_owned()]), ..folder.options() };
    folder.fit(&chosen, 1).expect("x has several values");
}

#[test]
fn a_class_that_not_every_fold_has_is_refused() {
    let folder = rows(9, "recording,class", |press| if press < 7 { "a" } else { "b" }.to_owned());
    refused(&folder, &folder.options(), &["at least 3 presses of each class", "2 of b"]);
    let folder = rows(9, "recording,class", |_| "a".to_owned());
    refused(&folder, &folder.options(), &["at least two classes", "found a"]);
}

#[test]
fn values_that_are_not_finite_are_left_out_or_refused() {
    let folder =
        rows(7, "recording,x_mm", |press| if press == 0 { "nan".to_owned() } else { press.to_string() });
    let report = folder.fit(&folder.options(), 1).expect("six are left").report;
    assert_eq!(report.data.presses, 6);
}

#[test]
fn labels_are_chosen_by_their_names_and_fit_together() {
    let folder = rows(9, "recording,x_mm,class", |press| format!("{press},{}", ["a", "b", "c"][press % 3]));
    let of = |names: &[&str]| {
        let names = names.iter().map(|name| (*name).to_owned()).collect();
        Options { labels: Some(names), ..folder.options() }
    };
    refused(&folder, &of(&["force"]), &["expected x, class, found force"]);
    refused(&folder, &of(&["x", "class"]), &["labels of numbers, or one label of classes", "class"]);
    refused(&folder, &of(&["x", "x"]), &["each label once", "x again"]);
}

#[test]
fn networks_without_layers_of_events_are_refused() {
    let folder = places(6);
    let of = |network: &str| Options { network: network.to_owned(), weights: None, ..folder.options() };
    refused(&folder, &of("canf"), &["canf", "network over events"]);
    refused(&folder, &of("tactigraph-pas"), &["tactigraph-pas"]);
    refused(&folder, &of("graphres-published"), &["graphres-published"]);
    let place = tempfile::tempdir().expect("there is a place for temporary files");
    let path = place.path().join("counts.toml");
    let text = "[network]\nname = \"counts\"\nplace = [\"1/8\", \"1/8\"]\n[graph]\nkind = \"knn\"\nk = 1\ncandidates = \"past\"\nlifetime = \"frozen\"\nscale = 0.1\n\
                [[layer]]\nname = \"grid\"\nkind = \"readout\"\ngrid = [4, 4]\n[[layer]]\nname = \"out\"\nkind = \"dense\"\n\
                outputs = 1\n[output]\nnames = [\"x\"]\nunit = \"mm\"\n";
    std::fs::write(&path, text).expect("it can be written");
    refused(&folder, &of(&path.display().to_string()), &["layers of events"]);
}

#[test]
fn copies_of_a_press_are_left_out() {
    let folder = rows(7, "recording,x_mm", |press| press.to_string());
    std::fs::copy(folder.path().join("press1.es"), folder.path().join("press6.es"))
        .expect("it can be copied");
    let report = folder.fit(&folder.options(), 1).expect("six are left").report;
    assert_eq!(report.data.presses, 6);
    assert!(report.data.notes.iter().any(|note| note.contains("copies")), "{:?}", report.data.notes);
}

//! The book: its contents are the pages of `docs`, links have targets, and listings have anchors.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use crate::house::{files, root};

/// The pages below `docs`.
fn pages() -> Vec<PathBuf> {
    files(&root().join("docs"), "md")
}

pub(crate) fn text(page: &Path) -> String {
    fs::read_to_string(page).unwrap_or_else(|error| panic!("{}: {error}", page.display()))
}

/// The lines of a page outside of its blocks of code.
pub(crate) fn prose(text: &str) -> impl Iterator<Item = &str> {
    let mut in_code = false;
    text.lines().filter(move |line| {
        let is_fence = line.trim_start().starts_with("```");
        in_code ^= is_fence;
        !in_code && !is_fence
    })
}

/// The targets of the links and pictures of a page.
fn links(text: &str) -> Vec<String> {
    let mut links = Vec::new();
    for line in prose(text) {
        // Code within a line has no links.
        let outside: String = line.split('`').step_by(2).collect::<Vec<_>>().join("`");
        for part in outside.split("](").skip(1) {
            if let Some((target, _)) = part.split_once(')') {
                links.push(target.to_owned());
            }
        }
    }
    links
}

/// The name of a heading in links, as GitHub and mdBook make it.
fn slug(heading: &str) -> String {
    let kept = heading.trim().to_lowercase();
    let kept = kept.chars().filter(|&c| c.is_alphanumeric() || c == ' ' || c == '-' || c == '_');
    kept.map(|c| if c == ' ' { '-' } else { c }).collect()
}

/// The names of the headings of a page.
fn headings(text: &str) -> BTreeSet<String> {
    let heading = |line: &str| line.starts_with('#').then(|| slug(line.trim_start_matches('#')));
    prose(text).filter_map(heading).collect()
}

#[test]
fn the_contents_of_the_book_are_its_pages() {
    let docs = root().join("docs");
    let summary = text(&docs.join("SUMMARY.md"));
    let listed: BTreeSet<PathBuf> = links(&summary).into_iter().map(|link| docs.join(link)).collect();
    let there: BTreeSet<PathBuf> = pages().into_iter().filter(|page| !page.ends_with("SUMMARY.md")).collect();
    assert_eq!(listed, there);
}

#[test]
fn each_link_of_a_page_leads_to_a_file_and_its_heading() {
    let mut broken = Vec::new();
    let of_root = ["README.md", "ARCHITECTURE.md", "CONTRIBUTING.md"].map(|name| root().join(name));
    for page in pages().into_iter().chain(of_root) {
        let found = text(&page);
        for link in links(&found) {
            if link.starts_with("http://") || link.starts_with("https://") {
                continue;
            }
            let (path, part) = link.split_once('#').unwrap_or((&link, ""));
            let target =
                if path.is_empty() { page.clone() } else { page.parent().expect("a folder").join(path) };
            let leads = target.exists()
                && (part.is_empty() || target.is_dir() || headings(&text(&target)).contains(part));
            if !leads {
                broken.push(format!("{}: {link}", page.display()));
            }
        }
    }
    assert!(broken.is_empty(), "{}", broken.join("\n"));
}

#[test]
fn each_listing_of_a_page_is_a_part_of_a_file() {
    let mut count = 0;
    for page in pages() {
        let found = text(&page);
        for listing in found.split("{{#include ").skip(1) {
            let listing = listing.split("}}").next().expect("an end");
            let (path, anchor) = listing.split_once(':').expect("an anchor");
            let source = text(&page.parent().expect("a folder").join(path));
            let marks = [format!("ANCHOR: {anchor}"), format!("ANCHOR_END: {anchor}")];
            assert!(marks.iter().all(|mark| source.contains(mark)), "{}: {listing}", page.display());
            count += 1;
        }
    }
    assert!(count >= 6, "{count}");
}

#[test]
fn a_heading_has_the_name_that_links_use() {
    assert_eq!(slug(" Where `x` is, and 2 more!"), "where-x-is-and-2-more");
    assert_eq!(links("[a](b.md#c) `[no](x)` ![p](d.svg)\n```\n[no](y)\n```"), ["b.md#c", "d.svg"]);
}

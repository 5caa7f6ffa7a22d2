//! The files of the page, inside the program.

/// Files of the folder `page` by name.
macro_rules! files {
    ($($name:literal),* $(,)?) => {
        [$(($name, include_bytes!(concat!("../../page/", $name)).as_slice())),*]
    };
}

static FILES: [(&str, &[u8]); 14] = files!(
    "index.html",
    "style.css",
    "main.js",
    "source.js",
    "frame.js",
    "state.js",
    "events.js",
    "frames.js",
    "sensors.js",
    "wave.js",
    "plots.js",
    "panels.js",
    "colours.js",
    "icon.svg",
);

/// The file at a path of a request, with its name.
pub(super) fn file(path: &str) -> Option<(&'static str, &'static [u8])> {
    let name = match path.strip_prefix('/')? {
        "" => "index.html",
        name => name,
    };
    FILES.iter().copied().find(|(of, _)| *of == name)
}

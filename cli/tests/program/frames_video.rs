//! Networks over raw video: files, streams, and cameras that do not wait.

use std::fs::File;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use meissner_io::write_png;
use serde_json::Value;

use crate::exit_status::fails;
use crate::frames::OwnNetwork;
use crate::frames_pictures::{FORCES, HEIGHT, WIDTH};
use crate::sockets::{connected, free_address};
use crate::support::{argument, command, headed_lines, lines, meissner, meissner_reading, message, words};

/// Bytes of a picture.
const BYTES: usize = WIDTH * HEIGHT * 3;

/// A network over differences from the first picture.
fn of_differences() -> OwnNetwork {
    let description = FORCES.replace("frames = \"picture\"", "frames = \"picture\"\ndifference = true");
    OwnNetwork::new(&description.replace("mean = [0.5, 0.5, 0.5]", "mean = [0.0, 0.0, 0.0]"))
}

/// Picture number `number` of a video, red, green and blue: a square that moves over a gradient.
fn picture(number: usize) -> Vec<u8> {
    let (left, top) = (number % (WIDTH - 2), number / 2 % (HEIGHT - 2));
    let mut bytes = Vec::with_capacity(BYTES);
    for y in 0..HEIGHT {
        for x in 0..WIDTH {
            let inside = (left..left + 3).contains(&x) && (top..top + 3).contains(&y);
            let level = if inside { 250 - (number % 90) as u8 } else { 40 + (x * 7 + y * 5) as u8 };
            bytes.extend([level, level / 2, 200 - level / 2]);
        }
    }
    bytes
}

fn video(pictures: usize) -> Vec<u8> {
    (0..pictures).flat_map(picture).collect()
}

/// A folder of PNG pictures.
fn folder(network: &OwnNetwork, name: &str, pictures: impl IntoIterator<Item = Vec<u8>>) -> PathBuf {
    let folder = network.path(name);
    std::fs::create_dir(&folder).expect("it is not there");
    for (number, rgb) in pictures.into_iter().enumerate() {
        write_png(&folder.join(format!("{number}.png")), WIDTH, HEIGHT, &rgb).expect("it can be written");
    }
    folder
}

/// The arguments that run `network` on the video `input`.
fn run<'a>(network: &OwnNetwork, input: &'a str, video: &'a str, more: &[&'a str]) -> Vec<String> {
    network.arguments(Path::new(input), &[&["--video", video, "--json"], more].concat())
}

fn reading(arguments: &[String], input: &[u8]) -> std::process::Output {
    meissner_reading(&arguments.iter().map(String::as_str).collect::<Vec<_>>(), input)
}

/// The predictions, without the names of pictures and the run times.
fn reports(predictions: &[Value]) -> Vec<Value> {
    let mut reports = predictions.to_vec();
    for report in &mut reports {
        let keys = report.as_object_mut().expect("a prediction is an object");
        keys.retain(|key, _| !["image", "picture", "update_us", "since_arrival_us"].contains(&key.as_str()));
    }
    assert!(reports.iter().any(|report| report["area_mm2"].as_f64() > Some(0.0)), "{reports:?}");
    reports
}

/// The numbers of the pictures with predictions.
fn numbers(predictions: &[Value]) -> Vec<u64> {
    predictions.iter().map(|line| line["picture"].as_u64().expect("a number")).collect()
}

#[test]
fn a_raw_video_gives_the_predictions_of_its_pictures_in_files() {
    let swapped = |mut bytes: Vec<u8>| {
        bytes.chunks_exact_mut(3).for_each(|pixel| pixel.swap(0, 2));
        bytes
    };
    let greys = |bytes: Vec<u8>| bytes.into_iter().skip(2).step_by(3).collect::<Vec<_>>();
    let grey = |bytes: Vec<u8>| bytes.chunks_exact(3).flat_map(|pixel| [pixel[2]; 3]).collect::<Vec<_>>();
    for network in [OwnNetwork::new(FORCES), of_differences()] {
        let in_colour = folder(&network, "colour", (0..9).map(picture));
        let in_grey = folder(&network, "grey", (0..9).map(picture).map(grey));
        let reference = in_colour.join("4.png");
        for more in [&[][..], &["--reference", argument(&reference)], &["--limit", "5"]] {
            for (format, pictures, bytes) in [
                ("8x6", &in_colour, video(9)),
                ("8x6:rgb24", &in_colour, video(9)),
                ("8x6:bgr24", &in_colour, swapped(video(9))),
                ("8x6:gray8", &in_grey, greys(video(9))),
            ] {
                // One format with every option, and every format without.
                if format != "8x6" && !more.is_empty() {
                    continue;
                }
                let expected =
                    lines(&meissner(&network.arguments(pictures, &[&["--json"], more].concat()))).0;
                let file = network.path("video.rgb");
                std::fs::write(&file, &bytes).expect("it can be written");
                let on_input = run(&network, "-", format, more);
                let in_file = run(&network, argument(&file), format, more);
                let redirected = File::open(&file).expect("it was written");
                let redirected = command(&on_input).stdin(redirected).output().expect("it starts");
                for (output, is_live) in
                    [(reading(&on_input, &bytes), true), (meissner(&in_file), false), (redirected, false)]
                {
                    let (found, summary) = lines(&output);
                    assert_eq!(reports(&found), reports(&expected), "{format} {more:?}");
                    assert_eq!(numbers(&found), (0..expected.len() as u64).collect::<Vec<_>>());
                    assert!(found.iter().all(|line| line["since_arrival_us"].is_number() == is_live));
                    assert_eq!(summary["latency_us"]["arrival"].is_object(), is_live);
                    assert_eq!(summary["pictures"], expected.len());
                    assert_eq!(
                        (&summary["pictures_late"], &summary["bytes_left_out"]),
                        (&0.into(), &0.into())
                    );
                }
            }
        }
    }
}

#[test]
fn of_a_file_no_picture_is_late_whatever_its_rate() {
    let network = of_differences();
    let file = network.path("video.rgb");
    std::fs::write(&file, video(40)).expect("it can be written");
    for rate in ["100000", "29.97", "30000/1001", "0.001"] {
        let output = meissner(&run(&network, argument(&file), &format!("8x6@{rate}"), &[]));
        let (_, predictions, summary) = headed_lines(&output);
        assert_eq!(numbers(&predictions), (0..40).collect::<Vec<_>>());
        assert_eq!((&summary["pictures"], &summary["pictures_late"]), (&40.into(), &0.into()));
        // With a rate, pictures have times, against which the network is measured.
        assert!(summary["real_time"].is_number());
    }
    let output = meissner(&run(&network, argument(&file), "8x6@25", &[]));
    let (header, ..) = headed_lines(&output);
    assert_eq!(header["input"]["format"], "raw video, rgb24, 8x6 pixels, 25 pictures a second");
}

#[test]
fn late_pictures_of_a_camera_are_counted_and_the_others_give_what_they_give_alone() {
    const PICTURES: u64 = 300;
    let network = of_differences();
    // A picture is late after 0.1 ms, and more come at once than may wait.
    let arguments = run(&network, "-", "8x6@10000", &[]);
    let child =
        command(&arguments).stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn();
    let mut child = child.expect("the program starts");
    let mut camera = child.stdin.take().expect("standard input is piped");
    for burst in video(PICTURES as usize).chunks(15 * BYTES) {
        camera.write_all(burst).expect("the program reads");
        std::thread::sleep(std::time::Duration::from_millis(10));
    }
    drop(camera);
    let (predictions, summary) = lines(&child.wait_with_output().expect("the program ends"));
    let (numbers, late) = (numbers(&predictions), summary["pictures_late"].as_u64().expect("a count"));
    assert_eq!(summary["pictures"], PICTURES);
    assert_eq!(numbers.len() as u64 + late, PICTURES);
    assert!(late > 0, "{summary}");
    assert!(numbers.is_sorted_by(|a, b| a < b) && numbers.last() == Some(&(PICTURES - 1)), "{numbers:?}");
    let alone = folder(&network, "alone", numbers.iter().map(|&number| picture(number as usize)));
    let (expected, _) = lines(&meissner(&network.arguments(&alone, &["--json"])));
    assert_eq!(reports(&predictions), reports(&expected));
}

#[test]
fn a_rest_of_a_picture_is_counted_and_told_and_an_error_only_with_strict() {
    let network = of_differences();
    let mut bytes = video(3);
    bytes.truncate(2 * BYTES + 11);
    for format in ["8x6", "8x6@0.1"] {
        let output = reading(&run(&network, "-", format, &[]), &bytes);
        let (predictions, summary) = lines(&output);
        assert_eq!(predictions.len(), 2);
        assert_eq!((&summary["pictures"], &summary["bytes_left_out"]), (&2.into(), &11.into()));
        let said = message(&output);
        assert!(said.contains("standard input: the last 11 bytes are no whole picture of 144"), "{said}");
        let strict = reading(&run(&network, "-", format, &["--strict"]), &bytes);
        assert_eq!(strict.status.code(), Some(1));
        let said = message(&strict);
        assert!(said.contains("picture at byte 288 is cut short: expected 144 bytes, found 11"), "{said}");
        assert!(String::from_utf8_lossy(&strict.stdout).contains("\"pictures\":2,"), "with its summary");
        // The rest was not requested.
        let (_, summary) = lines(&reading(&run(&network, "-", format, &["--limit", "2"]), &bytes));
        assert_eq!((&summary["pictures"], &summary["bytes_left_out"]), (&2.into(), &0.into()));
    }
    let arguments = network.arguments(Path::new("-"), &["--video", "8x6@0.1"]);
    let said = words(&reading(&arguments, &bytes));
    assert!(said.contains("pictures 2") && said.contains("left out 11 bytes at the end"), "{said}");
}

#[test]
fn an_input_without_a_whole_picture_is_an_error() {
    let network = of_differences();
    for (bytes, found) in [(&[][..], "found 0"), (&[1; 143], "found 143")] {
        for format in ["8x6", "8x6@25"] {
            let output = reading(&run(&network, "-", format, &[]), bytes);
            assert_eq!(output.status.code(), Some(1));
            let said = message(&output);
            for expected in ["standard input", "picture at byte 0", "expected 144 bytes", found] {
                assert!(said.contains(expected), "{expected}: {said}");
            }
        }
    }
    fails(&meissner(&run(&network, "no/such/video", "8x6", &[])), 1, &["cannot open no/such/video"]);
}

#[test]
fn a_video_that_does_not_fit_is_bad_usage() {
    let network = of_differences();
    for (video, expected) in [
        ("8x7", "8x6 pixels, as network "),
        ("0x6", "at least 1x1 pixels, found 0x6"),
        ("8x0@25", "at least 1x1 pixels, found 8x0"),
        ("4294967296x4294967296", "at most 16777216 pixels"),
        ("18446744073709551616x1", "columns x rows"),
        ("8", "columns x rows"),
        ("8x", "columns x rows"),
        ("8x-6", "columns x rows"),
        ("8x6@0", "pictures a second"),
        ("8x6@-25", "pictures a second"),
        ("8x6@NaN", "pictures a second"),
        ("8x6@25/0", "pictures a second"),
        ("8x6@", "pictures a second"),
        ("8x6:yuv420p", "rgb24, bgr24 or gray8"),
        ("8x6@25:", "rgb24, bgr24 or gray8"),
    ] {
        fails(&meissner(&run(&network, "-", video, &[])), 2, &["--video", expected]);
    }
    let datagrams = meissner(&run(&network, "udp://127.0.0.1:0", "8x6@25", &[]));
    fails(&datagrams, 2, &["--video", "TCP", "udp://127.0.0.1:0: a picture is longer than a datagram"]);
    let packets = meissner(&run(&network, "dv://127.0.0.1:1", "8x6@25", &[]));
    fails(&packets, 2, &["--video", "TCP", "dv://127.0.0.1:1: packets of AEDAT4"]);
    for other in ["force-lstm", "slip-lstm", "graphres"] {
        let output = meissner(&["run", "-", "--network", other, "--video", "8x6"]);
        fails(&output, 2, &["--video", other, "a network over pictures"]);
    }
}

#[test]
fn overlays_of_a_video_are_named_after_the_numbers_of_its_pictures() {
    let network = OwnNetwork::new(FORCES);
    let maps = network.path("maps");
    let (predictions, _) =
        lines(&reading(&run(&network, "-", "8x6", &["--overlay", argument(&maps)]), &video(3)));
    for (number, line) in predictions.iter().enumerate() {
        assert_eq!(line["overlay"], argument(&maps.join(format!("{number:06}.png"))));
    }
    assert_eq!(std::fs::read_dir(&maps).expect("it was made").count(), 3);
}

#[test]
fn a_video_is_read_over_tcp() {
    let network = of_differences();
    let (expected, _) = lines(&reading(&run(&network, "-", "8x6", &[]), &video(4)));
    let address = free_address();
    let arguments = run(&network, &format!("tcp-listen://{address}"), "8x6@0.1", &[]);
    let child = command(&arguments).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn();
    let child = child.expect("the program starts");
    let mut camera = connected(&address);
    camera.write_all(&video(4)).expect("the program reads");
    drop(camera);
    let (found, _) = lines(&child.wait_with_output().expect("it ends"));
    assert_eq!(reports(&found), reports(&expected));
}

#[cfg(unix)]
#[test]
fn a_signal_ends_a_video_with_its_summary() {
    use std::fs::OpenOptions;

    let network = of_differences();
    for (format, name) in [("8x6", "INT"), ("8x6@25", "INT"), ("8x6@25", "TERM")] {
        let arguments = run(&network, "-", format, &[]);
        let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
        let mut running = crate::signals::Running::new(&arguments);
        for number in 0..2 {
            // This would wait without end if a picture were held back.
            running.send(&picture(number));
            assert_eq!(running.line()["picture"], number);
        }
        running.send(&picture(2)[..20]);
        running.signal(name);
        let summary = running.end();
        assert_eq!((&summary["pictures"], &summary["bytes_left_out"]), (&2.into(), &0.into()), "{name}");
    }
    // A file may be a pipe, too: a camera.
    let path = network.path("camera");
    assert!(Command::new("mkfifo").arg(&path).status().expect("there is such a program").success());
    let arguments = run(&network, argument(&path), "8x6@25", &[]);
    let mut running = crate::signals::Running::new(&arguments.iter().map(String::as_str).collect::<Vec<_>>());
    let mut camera = OpenOptions::new().write(true).open(&path).expect("the program reads");
    camera.write_all(&picture(0)).expect("the program reads");
    assert!(running.line()["since_arrival_us"].is_number());
    running.signal("INT");
    assert_eq!(running.end()["pictures"], 1);
}

/// A reader of the predictions does not delay the camera, and no backlog grows.
#[cfg(target_os = "linux")]
#[test]
fn where_nobody_reads_the_output_a_camera_does_not_wait() {
    use std::io::{Read, pipe};
    use std::os::fd::AsRawFd;
    use std::os::unix::fs::OpenOptionsExt;

    const PICTURES: usize = 5000;
    let network = of_differences();
    let (mut reader, writer) = pipe().expect("there are pipes");
    // It is filled up through a handle that does not wait: O_NONBLOCK.
    let path = format!("/proc/self/fd/{}", writer.as_raw_fd());
    let full = std::fs::OpenOptions::new().write(true).custom_flags(0o4000).open(path);
    let (mut full, mut filled) = (full.expect("it is there"), 0);
    while let Ok(written) = full.write(&[b'\n'; 4096]) {
        filled += written;
    }
    drop(full);
    let mut child = command(&run(&network, "-", "8x6@25", &[]))
        .stdin(Stdio::piped())
        .stdout(writer)
        .spawn()
        .expect("the program starts");
    let mut camera = child.stdin.take().expect("standard input is piped");
    // More than pipes can hold.
    camera.write_all(&video(PICTURES)).expect("the program reads");
    drop(camera);
    let mut output = Vec::new();
    reader.read_to_end(&mut output).expect("the program ends");
    assert!(child.wait().expect("the program ends").success());
    let output = String::from_utf8(output[filled..].to_owned()).expect("it is text");
    let summary: Value =
        serde_json::from_str(output.lines().last().expect("there is a summary")).expect("JSON");
    let summary = &summary["summary"];
    let count = |key: &str| summary[key].as_u64().expect("a count");
    assert_eq!((count("pictures"), count("pictures_late") + count("frames")), (5000, 5000));
    assert!(count("pictures_late") > 4000, "{summary}");
}

/// ffmpeg, if it is installed.
fn ffmpeg() -> Option<Command> {
    let found = Command::new("ffmpeg").arg("-version").stdout(Stdio::null()).stderr(Stdio::null()).status();
    if !found.is_ok_and(|status| status.success()) {
        println!("skipped: ffmpeg is not installed");
        return None;
    }
    let mut ffmpeg = Command::new("ffmpeg");
    ffmpeg.args(["-v", "error", "-nostdin"]);
    Some(ffmpeg)
}

#[test]
fn what_ffmpeg_pipes_is_predicted_as_the_pictures_that_it_writes() {
    let network = of_differences();
    let pictures = network.path("pictures");
    std::fs::create_dir(&pictures).expect("it is not there");
    for (pixels, of_files) in [("rgb24", "rgb24"), ("bgr24", "rgb24"), ("gray", "gray")] {
        let (Some(mut raw), Some(mut files)) = (ffmpeg(), ffmpeg()) else { return };
        let source = ["-f", "lavfi", "-i", "testsrc=size=320x240:rate=25", "-frames:v", "6", "-s", "8x6"];
        let target = pictures.join("%d.png");
        let written = files.args(source).args(["-pix_fmt", of_files, "-y", argument(&target)]).status();
        assert!(written.expect("it is installed").success());
        let piped = raw.args(source).args(["-f", "rawvideo", "-pix_fmt", pixels, "-"]).output();
        let piped = piped.expect("it is installed").stdout;
        let (found, _) = lines(&reading(&run(&network, "-", &format!("8x6:{pixels}"), &[]), &piped));
        let (expected, _) = lines(&meissner(&network.arguments(&pictures, &["--json"])));
        assert_eq!((found.len(), reports(&found)), (6, reports(&expected)), "{pixels}");
    }
}

#[test]
fn a_network_that_has_the_time_takes_what_ffmpeg_gives_at_the_speed_of_a_camera() {
    let Some(mut camera) = ffmpeg() else { return };
    let network = of_differences();
    camera.args(["-re", "-f", "lavfi", "-i", "testsrc=size=320x240:rate=25", "-t", "3", "-s", "8x6"]);
    let camera = camera.args(["-f", "rawvideo", "-pix_fmt", "rgb24", "-"]).stdout(Stdio::piped()).spawn();
    let mut camera = camera.expect("it is installed");
    let pictures = camera.stdout.take().expect("it is piped");
    let output = command(&run(&network, "-", "8x6@25", &[])).stdin(pictures).output();
    let (predictions, summary) = lines(&output.expect("the program starts"));
    assert!(camera.wait().expect("it ends").success());
    let late = summary["pictures_late"].as_u64().expect("a count");
    assert_eq!((&summary["pictures"], predictions.len() as u64 + late), (&75.into(), 75));
    // Other tests may keep this one from the processor for longer than a picture lasts.
    assert!(late < 10, "{summary}");
}

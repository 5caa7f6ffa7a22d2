//! Writes the seeds of the corpora: `cargo run -p meissner-fuzz --example seeds`.
//!
//! The bytes come from the writers in the tests of each reader, which share no code with the
//! reader.

use std::fs;
use std::io::{self, Write};

use flate2::write::GzEncoder;
use meissner_engine::Event;
use meissner_fuzz::{NETWORK, corpus, snapshot_seeds};
use meissner_io::Format;
use meissner_io_tests::codecs::aedat4::{Compression, File, event_packet};
use meissner_io_tests::{codecs, images};
use meissner_models::{AnyDescription, Description, TensorFile, draw};

#[allow(dead_code, reason = "the tests use more of it")]
#[path = "../../../models/tests/support/torch.rs"]
mod torch;

use torch::{Deviation, Pickle, View, archive, state_dict};

fn main() -> io::Result<()> {
    recordings()?;
    sockets()?;
    electrodes()?;
    labels()?;
    pictures()?;
    weights()?;
    descriptions()?;
    let (events, frames) = snapshot_seeds();
    for (target, seeds) in [("snapshot", events), ("frame_snapshot", frames)] {
        for (i, bytes) in seeds.into_iter().enumerate() {
            // The same without the byte that requests a right checksum.
            let plain = [&[i as u8, 0], &bytes[2..]].concat();
            put(target, &format!("engine{i}"), &bytes)?;
            put(target, &format!("engine{i}-as-it-is"), &plain)?;
        }
    }
    scripts()
}

fn put(target: &str, name: &str, bytes: &[u8]) -> io::Result<()> {
    let folder = corpus::folder().join(target);
    fs::create_dir_all(&folder)?;
    fs::write(folder.join(name), bytes)
}

/// Input that may arrive on a socket, after a byte that chooses the protocol.
fn sockets() -> io::Result<()> {
    let near: Vec<_> =
        (0..40).map(|i| Event::new(i * 1_000, i as u16 % 30, i as u16 % 7, i % 3 > 0)).collect();
    let text = codecs::encoded(Format::Csv, None, &near);
    let odd = String::from_utf8_lossy(&text).replace("5,", "x,").into_bytes();
    for (choice, name, bytes) in [
        (1, "text", text.clone()),
        (1, "odd-lines", odd),
        (5, "datagrams", text),
        (2, "evt2", codecs::evt2("", &codecs::evt2_words(&near))),
        (3, "evt3", codecs::encoded(Format::Evt3, None, &near)),
        (4, "aedat4", codecs::encoded(Format::Aedat4, Some(codecs::SENSOR), &near).split_off(14)),
    ] {
        put("socket", name, &[&[choice], &bytes[..]].concat())?;
    }
    Ok(())
}

fn recordings() -> io::Result<()> {
    for (i, (format, bytes)) in codecs::samples().into_iter().enumerate() {
        let target = format.to_string().to_lowercase().replace(['-', '.'], "");
        put(&target, &format!("sample{i}"), &bytes)?;
        put("any_recording", &format!("{target}{i}"), &bytes)?;
    }
    let events = &codecs::events()[..3];
    for compression in Compression::ALL {
        let mut file = File::new(compression, None);
        file.push(0, &event_packet(events));
        put("aedat4", &format!("no-sensor-{compression:?}").to_lowercase(), &file.bytes())?;
        file.table = None;
        put("aedat4", &format!("not-closed-{compression:?}").to_lowercase(), &file.bytes())?;
    }
    bags(events)?;
    put("evt2", "bare", &codecs::evt2("", &codecs::evt2_words(events)))?;
    put(
        "evt2",
        "format",
        &codecs::evt2("% format EVT2;height=720;width=1280\n", &codecs::evt2_words(events)),
    )?;
    put(
        "evt2",
        "trigger",
        &codecs::evt2("% evt 2.0\n", &[0x8000_0001, 0xa040_0101, 0x1000_0801, 0xe000_0000]),
    )?;
    let words = codecs::evt21_words(events);
    put("evt21", "little", &codecs::evt21("% evt 2.1\n% endianness little\n", &words, false))?;
    put("evt21", "told-by-time", &codecs::evt21("% evt 2.1\n% end\n", &words, true))?;
    for (first, bytes) in [
        (0, codecs::evt2("", &codecs::evt2_words(events))),
        (1, codecs::evt21("% format EVT21;endianness=legacy\n% end\n", &words, true)),
        (2, codecs::encoded(Format::Evt3, None, events)),
        (3, codecs::aedat4::sample(Compression::Lz4)),
        // As a network stream begins.
        (7, codecs::encoded(Format::Aedat4, Some(codecs::SENSOR), events).split_off(14)),
    ] {
        put("raw", &format!("whole-{first}"), &[&[first], &bytes[..]].concat())?;
        // A byte is lost in the middle.
        let (left, right) = bytes.split_at(bytes.len() / 2);
        put("raw", &format!("lost-{first}"), &[&[first], left, &right[1..]].concat())?;
    }
    // Row, column, vectors of 12 and of 8, a trigger and words of the vendor.
    let vectors = [0x8001, 0x6002, 0x0003, 0x3805, 0x4fff, 0x50ff, 0x2001, 0xa101, 0xe000, 0xf000];
    put("evt3", "vectors", &codecs::evt3("% evt 3.0\n% geometry 640x480\n% end\n", &vectors))?;
    put(
        "evt3",
        "wrap",
        &codecs::evt3("% format EVT3\n% end\n", &[0x8fff, 0x6fff, 0x0001, 0x2001, 0x8000, 0x6000, 0x2802]),
    )?;
    put("dat", "no-sensor", &codecs::encoded(Format::Dat, None, events))?;
    let on_128: Vec<_> = events.iter().map(|e| Event { y: e.y % 128, ..*e }).collect();
    let records = codecs::aedat::dvs128_records(&on_128);
    put("aedat2", "no-chip", &codecs::aedat::aedat2(&["created by hand"], &records))?;
    let words = [0, 1 << 31, 1 << 31 | 3 << 10, 1 << 10].map(|word| [word, u32::MAX]);
    put("aedat2", "frames-imu", &codecs::aedat::aedat2(&codecs::aedat::DAVIS346, &words))?;
    let packets = [(0, 8, 3), (1, 8, 1), (3, 36, 1)].map(|(kind, size, number)| {
        codecs::aedat::aedat3_packet(kind, 0, size, 1, &vec![5; (size * number) as usize])
    });
    put("aedat3", "types", &[codecs::aedat::aedat3_header(0, "DVS128"), packets.concat()].concat())?;
    // Files from another library, in the tests of the reader.
    for file in fs::read_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/../../io/tests/codecs/hdf5"))? {
        let path = file?.path();
        if path.extension().is_some_and(|extension| extension == "h5") {
            let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
            put("hdf5", &name, &fs::read(&path)?)?;
        }
    }
    put("es", "resets", b"Event Stream\x02\0\0\x01\x04\0\x03\0\xfe\xfe\xff\x03\x01\0\x02\0\xff")?;
    put("nmnist", "one", &[1, 2, 0x80, 0, 9])?;
    let dat = codecs::encoded(Format::Dat, None, events);
    let mut gzip = GzEncoder::new(Vec::new(), flate2::Compression::default());
    gzip.write_all(&dat)?;
    put("any_recording", "gzip", &gzip.finish()?)?;
    put("any_recording", "zip", &stored_zip("a.dat", &dat))?;
    let texts = [
        ("plain", "10,3,4,1\n12,3,5,0\n"),
        ("names", "\u{feff}P, X ,\"y\",timestamp,other\r\nTrue,1,2,3.00,x\r\n\r\n# more\r\n-1,4,5,-6,\r\n"),
        ("sensor", "# sensor 4x3\nt,x,y,p\n1,3,2,+1\n"),
        ("far", "-9223372036854775808,65535,65535,1\n9223372036854775807,0,0,0"),
        ("blanks", "14 27 70000 1\n15\t28  70040 -1\n"),
        ("seconds", "240 180\n0.000000000 96 133 0\n0.003811499 11 2 1\n"),
        ("semicolons", "% by hand\n# x y t p\n1;2;5;1\n3;4;9;0\n"),
        ("units", "time_ms p x y\n0.0055 1 3 4\n-1.5 0 1 2\n"),
        ("several-orders", "1 2 3 1\n2 3 4 0\n"),
    ];
    for (name, text) in texts {
        put("csv", name, text.as_bytes())?;
    }
    let header = "{'descr': [('t', '>i8'), ('pad', '|V3'), ('x', '|u1'), ('y', '<i2'), ('p', '|b1')], \
                  'fortran_order': False, 'shape': (1,), }";
    let npy = [&b"\x93NUMPY\x02\0"[..], &(header.len() as u32).to_le_bytes(), header.as_bytes(), &[0; 15]];
    put("npy", "other-types", &npy.concat())?;
    for (name, start) in [("near", [0_u8, 0]), ("sensor", [1, 200]), ("far", [0, 1])] {
        let steps: Vec<u8> = (0..90_u8).map(|i| i.wrapping_mul(37)).collect();
        put("convert", name, &[&start[..], &steps].concat())?;
    }
    put("convert", "in-order", &[&[0, 0][..], &[9, 0, 3, 0, 4, 0, 1].repeat(5)].concat())
}

/// MCAP of every encoding of events, and of every form of a picture.
fn bags(events: &[meissner_engine::Event]) -> io::Result<()> {
    use meissner_io_tests::codecs::mcap::{Cdr, channel, chunk, file, message, packet, schema};
    let bag = |name: &str, encoding: &str, data: &[u8]| {
        let declared = [schema(1, name), channel(1, 1, "/a", encoding)].concat();
        file(&[chunk("", &[declared, message(1, 9, data)].concat())])
    };
    let sensor = codecs::SENSOR;
    let words = |words: &[u16]| codecs::evt3("", words);
    for (encoding, content) in [
        ("evt3", words(&[0x8001, 0x6002, 0x0003, 0x2805, 0x3004, 0x4003])),
        ("libcaer_cmp", words(&[0x0003, 0x1004, 0x2007, 0x3809, 0x4010, 0x5005])),
        ("libcaer", vec![3, 0, 10, 0, 5, 0, 0, 0]),
        ("mono", vec![1; 16]),
    ] {
        let packets = [7, 9].map(|seq| packet(sensor, seq, 1_000, encoding, &content));
        let name = "event_camera_msgs/msg/EventPacket";
        let declared = [schema(1, name), channel(1, 1, "/a", "cdr"), channel(2, 1, "/b", "cdr")].concat();
        let messages = [message(1, 9, &packets[0]), message(1, 9, &packets[1]), message(2, 9, &packets[1])];
        put("mcap", encoding, &file(&[chunk("lz4", &[declared, messages.concat()].concat())]))?;
    }
    let mut array = Cdr::new(true);
    array.header();
    array.u32(260).u32(346).u32(events.len() as u32);
    for event in events {
        array.u16(event.x).u16(event.y).u32(1).u32(event.t_us as u32).u8(event.on.into());
    }
    put("mcap", "array", &bag("dvs_msgs/msg/EventArray", "cdr", &array.bytes))?;
    let mut pixels = Cdr::new(false);
    pixels.header();
    pixels.u32(1).u32(2).text("rgb8").u8(0).u32(7).sequence(&[5; 7]);
    put("mcap", "image", &bag("sensor_msgs/msg/Image", "cdr", &pixels.bytes))?;
    let png = meissner_io::encode_png(1, 1, &[7; 3]).map_err(io::Error::other)?;
    let mut picture = Cdr::new(false);
    picture.header();
    picture.text("png").sequence(&png);
    put("mcap", "compressed", &bag("sensor_msgs/msg/CompressedImage", "cdr", &picture.bytes))?;
    let json = br#"{"width":2,"height":1,"encoding":"mono8","step":2,"data":"BQU="}"#;
    put("mcap", "json", &bag("foxglove.RawImage", "json", json))?;
    let protobuf =
        [&[0x15, 2, 0, 0, 0, 0x1d, 1, 0, 0, 0, 0x22, 5][..], b"mono8", &[0x2d, 2, 0, 0, 0, 0x32, 2, 5, 5]];
    put("mcap", "protobuf", &bag("foxglove.RawImage", "protobuf", &protobuf.concat()))
}

/// An archive with one stored entry.
fn stored_zip(name: &str, content: &[u8]) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut archive = rawzip::ZipArchiveWriter::new(&mut bytes);
    let (mut entry, config) = archive.new_file(name).start().expect("memory");
    let mut writer = config.wrap(&mut entry);
    writer.write_all(content).expect("memory");
    let (_, descriptor) = writer.finish().expect("memory");
    entry.finish(descriptor).expect("memory");
    archive.finish().expect("memory");
    bytes
}

fn electrodes() -> io::Result<()> {
    let names: Vec<String> = (1..=24).map(|e| format!("ff_e{e}")).collect();
    let row = vec!["3500"; 24].join(",");
    put("electrodes", "rows", format!("{}\n{row}\n{row}\n", names.join(",")).as_bytes())?;
    let timed = [0, 10, 20, 20, 100, 90].map(|t| format!("{t},{row}\n")).concat();
    put("electrodes", "times", format!("time_ms,{}\n{timed}", names.join(",")).as_bytes())?;
    let reversed: Vec<String> = (1..=24).rev().map(|e| format!("\"Electrode {e}\"")).collect();
    let wrong = row.replacen("3500", "nan", 1);
    put(
        "electrodes",
        "bad-rows",
        format!("# a\r\n{}\r\n{wrong}\r\n1,2\r\n{row}\r\n", reversed.join(",")).as_bytes(),
    )
}

fn labels() -> io::Result<()> {
    for (name, text) in [
        ("instants", "recording,t_us,roll_deg,force_n\na,0,1.5,2\n\"b, c\",10,nan,-3e1\n"),
        ("presses", "# by hand\nfile;class;x [mm]\na;2;1,5\nb;10;\n;;\n"),
        ("poses", "\u{feff}host_ns\tz_um\tstate\r\n1717171717171717499\t1\t\"o\"\"n\"\r\n5\t2\toff\r\n"),
        ("bad", "recording,t_us,x\na,soon,1\n"),
    ] {
        put("labels", name, text.as_bytes())?;
    }
    Ok(())
}

fn pictures() -> io::Result<()> {
    for (i, (name, bytes)) in images::samples().into_iter().enumerate() {
        let target = match name {
            "JPEG" => "jpeg",
            "PPM" | "PGM" => "pnm",
            _ => "png",
        };
        put(target, &format!("sample{i}"), &bytes)?;
    }
    put("jpeg", "partial-blocks", &images::jpeg(9, 3, &[[10, 128, 128], [20, 90, 200]]))?;
    put("png", "grey16", &images::png(1, 2, 16, 0, &[0, 1, 2, 1, 3, 4]))?;
    put("png", "alpha", &images::png(1, 1, 8, 6, &[0, 1, 2, 3, 4]))?;
    put("pnm", "comment", b"P5# a\n2 # b\n1\n7\n\x01\x07")?;
    // Width, height, shift of both and pixels come before the pictures.
    let pictures: Vec<u8> = (0..60).collect();
    for (name, format, length) in [
        ("rgb", [2, 3, 0, 0], 54),
        ("bgr", [1, 1, 0, 1], 6),
        ("grey", [2, 2, 1, 2], 48),
        ("rest", [3, 2, 0, 0], 20),
        ("none", [0, 3, 0, 0], 9),
        ("huge", [255, 255, 55, 0], 9),
    ] {
        put("video", name, &[&format[..], &pictures[..length]].concat())?;
    }
    Ok(())
}

fn weights() -> io::Result<()> {
    let description = Description::parse(NETWORK).expect("a consistent description");
    let drawn = draw(&description, 3);
    let remark = [("about".to_owned(), "drawn".to_owned())];
    put("safetensors", "network", &drawn.to_safetensors(&remark.into()))?;
    let mut file = TensorFile::default();
    file.f32("a", &[2, 3], &[1.0, f32::NAN, f32::INFINITY, -0.0, 1e-40, 3.0]);
    file.i64("b", &[1], &[-1]);
    file.i32("c", &[0, 4], &[]);
    put("safetensors", "types", &file.into_bytes())?;
    let header = r#"{"h":{"dtype":"F16","shape":[2],"data_offsets":[0,4]},"b":{"dtype":"BF16","shape":[],"data_offsets":[4,6]},"d":{"dtype":"F64","shape":[1],"data_offsets":[6,14]}}"#;
    let bytes = [&(header.len() as u64).to_le_bytes()[..], header.as_bytes(), &[0x3c; 14]].concat();
    put("safetensors", "halves", &bytes)?;

    // The same network as a state dict: one storage for each tensor.
    let tensors: Vec<(&str, Vec<i64>, Vec<u8>)> = drawn
        .iter()
        .map(|(name, tensor)| {
            let values = tensor.values().expect("floats").iter().flat_map(|v| v.to_le_bytes()).collect();
            (name, tensor.shape().iter().map(|&size| size as i64).collect(), values)
        })
        .collect();
    let keys: Vec<String> = (0..tensors.len()).map(|i| i.to_string()).collect();
    let strides: Vec<Vec<i64>> = tensors
        .iter()
        .map(|(_, shape, _)| (1..=shape.len()).map(|i| shape[i..].iter().product()).collect())
        .collect();
    let views: Vec<(&str, View<'_>)> = (0..tensors.len())
        .map(|i| {
            let (name, shape, bytes) = &tensors[i];
            let values = bytes.len() as i64 / 4;
            let view = View {
                storage: "FloatStorage",
                key: &keys[i],
                values,
                offset: 0,
                shape,
                strides: &strides[i],
            };
            (*name, view)
        })
        .collect();
    let pickle = state_dict(&views);
    let storages: Vec<(&str, &[u8])> =
        tensors.iter().zip(&keys).map(|((_, _, bytes), key)| (key.as_str(), bytes.as_slice())).collect();
    put("torch", "network", &torch::file(&pickle, &storages))?;

    let view =
        View { storage: "FloatStorage", key: "0", values: 16, offset: 1, shape: &[2, 3], strides: &[1, 2] };
    let small = state_dict(&[("a", view), ("b", View { shape: &[], strides: &[], ..view })]);
    let entries: [(&str, &[u8]); 2] = [("data.pkl", &small.0), ("data/0", &[0; 64])];
    put("torch", "plain", &archive(&entries, Deviation::default()))?;
    put("torch", "wide", &archive(&entries, Deviation { wide: true, ..Deviation::default() }))?;
    put("torch", "compressed", &archive(&entries, Deviation { method: 8, ..Deviation::default() }))?;
    put("pickle", "views", &small.0)?;
    let nested = Pickle::new().raw(b"}(").text("epoch").int(70_000).text("list").raw(b"](K\x01K\x02e");
    let nested = nested.text("model").raw(&small.0[2..small.0.len() - 1]).raw(b"u.");
    put("pickle", "checkpoint", &nested.0)?;
    let parameter = Pickle::new().raw(b"}").text("p").global("torch._utils", "_rebuild_parameter").raw(b"(");
    let half = View { storage: "HalfStorage", values: 32, ..view };
    let parameter = parameter.tensor(&half).raw(&[0x88]).ordered_dict().raw(b"tRs.");
    put("pickle", "parameter", &parameter.0)?;
    let system = Pickle::new().global("os", "system").raw(b"(").text("true").raw(b"tR.");
    put("pickle", "os-system", &system.0)?;
    put("pickle", "deep", &[&[0x80, 2][..], b"N", &[0x85; 2000], b"."].concat())
}

fn descriptions() -> io::Result<()> {
    put("description", "small", NETWORK.as_bytes())?;
    for name in
        ["graphres-published", "tactigraph-frozen", "digits-past", "canf", "force-convlstm", "slip-best"]
    {
        let path = corpus::folder().join(format!("../../models/networks/{name}.toml"));
        let text = fs::read_to_string(path)?;
        AnyDescription::parse(&text).expect("a shipped description");
        put("description", name, text.as_bytes())?;
    }
    let head = r#"
[[head]]
name = "image"
kind = "conv"
channels = 2
kernel = 3
[[head]]
name = "flat"
kind = "flatten"
[[head]]
name = "out"
kind = "dense"
outputs = 1
"#;
    let (before, rest) = NETWORK.split_once("[[layer]]\nname = \"fc\"").expect("a dense layer");
    let output = &rest[rest.find("[output]").expect("an output")..];
    put("description", "head", format!("{before}{output}{head}").as_bytes())?;
    let large =
        NETWORK.replace("capacity = 16", "capacity = 65536").replace("channels = 2", "channels = 4096");
    put("description", "large", large.as_bytes())
}

/// Bytes for the targets that take them as choices.
fn scripts() -> io::Result<()> {
    for seed in 0..24_u64 {
        let mut random = meissner_verify::Random::new(seed);
        let length = 80 + random.below(600);
        let bytes: Vec<u8> = (0..length).map(|_| random.bits() as u8).collect();
        put("graph", &format!("script{seed}"), &bytes)?;
        put("interleavings", &format!("script{seed}"), &bytes)?;
        // Options of the right size, so that there is an engine.
        let options = [size_of::<meissner_c::meissner_engine_options>() as u8, (seed % 2) as u8];
        put("c_interface", &format!("script{seed}"), &[&options[..], &bytes].concat())?;
    }
    Ok(())
}

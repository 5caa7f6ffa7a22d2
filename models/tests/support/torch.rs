//! Bytes like those of `torch.save`: a pickle of protocol 2 and its storages, stored in a zip.

/// A pickle under construction.
#[derive(Clone, Default)]
pub(crate) struct Pickle(pub(crate) Vec<u8>);

impl Pickle {
    pub(crate) fn new() -> Self {
        Self(vec![0x80, 2])
    }

    pub(crate) fn raw(mut self, bytes: &[u8]) -> Self {
        self.0.extend(bytes);
        self
    }

    pub(crate) fn text(self, text: &str) -> Self {
        self.raw(b"X").raw(&(text.len() as u32).to_le_bytes()).raw(text.as_bytes())
    }

    pub(crate) fn int(self, value: i64) -> Self {
        match value {
            0..=0xff => self.raw(&[b'K', value as u8]),
            0x100..=0xffff => self.raw(b"M").raw(&(value as u16).to_le_bytes()),
            _ => self.raw(b"J").raw(&(value as i32).to_le_bytes()),
        }
    }

    pub(crate) fn global(self, module: &str, name: &str) -> Self {
        self.raw(format!("c{module}\n{name}\n").as_bytes())
    }

    pub(crate) fn sizes(mut self, sizes: &[i64]) -> Self {
        self = self.raw(b"(");
        for &size in sizes {
            self = self.int(size);
        }
        self.raw(b"t")
    }

    /// An empty `OrderedDict`.
    pub(crate) fn ordered_dict(self) -> Self {
        self.global("collections", "OrderedDict").raw(b")R")
    }

    /// A tensor as a view of storage `key`.
    pub(crate) fn tensor(self, view: &View<'_>) -> Self {
        self.global("torch._utils", "_rebuild_tensor_v2")
            .raw(b"((")
            .text("storage")
            .global("torch", view.storage)
            .text(view.key)
            .text("cpu")
            .int(view.values)
            .raw(b"tQ")
            .int(view.offset)
            .sizes(view.shape)
            .sizes(view.strides)
            .raw(&[0x89])
            .ordered_dict()
            .raw(b"tR")
    }
}

/// The reference of a pickled tensor.
#[derive(Clone, Copy)]
pub(crate) struct View<'a> {
    pub(crate) storage: &'a str,
    pub(crate) key: &'a str,
    pub(crate) values: i64,
    pub(crate) offset: i64,
    pub(crate) shape: &'a [i64],
    pub(crate) strides: &'a [i64],
}

/// A state dict of `tensors` with modules' `_metadata` and the memos of Python's pickler.
pub(crate) fn state_dict(tensors: &[(&str, View<'_>)]) -> Pickle {
    let mut pickle = Pickle::new().ordered_dict().raw(b"q\x00(");
    for (name, view) in tensors {
        pickle = pickle.text(name).raw(b"q\x01").tensor(view).raw(b"q\x02");
    }
    pickle
        .raw(b"u}")
        .text("_metadata")
        .ordered_dict()
        .raw(b"(")
        .text("")
        .raw(b"}")
        .text("version")
        .int(1)
        .raw(b"susb.")
}

/// Deviations of an archive from the plain one.
#[derive(Clone, Copy, Default)]
pub(crate) struct Deviation {
    /// Compression method of all entries.
    pub(crate) method: u16,
    /// Bytes that the directory claims for each entry, instead of the true number.
    pub(crate) size: Option<u32>,
    /// Sizes and positions in 64 bits.
    pub(crate) wide: bool,
}

/// An archive of stored `entries` under the folder "archive".
pub(crate) fn archive(entries: &[(&str, &[u8])], deviation: Deviation) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut directory = Vec::new();
    for (name, data) in entries {
        let name = format!("archive/{name}");
        let at = bytes.len() as u32;
        // Sizes in a descriptor after the data, and padding in an extra field, as in files of
        // PyTorch.
        let local = [0, 0x0808, deviation.method, 0, 0];
        bytes.extend(b"PK\x03\x04");
        bytes.extend(local.iter().flat_map(|v: &u16| v.to_le_bytes()));
        bytes.extend([0; 12]);
        bytes.extend((name.len() as u16).to_le_bytes());
        bytes.extend(8u16.to_le_bytes());
        bytes.extend(name.as_bytes());
        bytes.extend(b"FB\x04\x00ZZZZ");
        bytes.extend(*data);
        let size = deviation.size.unwrap_or(data.len() as u32);
        let crc = crc32(data);
        bytes.extend(b"PK\x07\x08");
        bytes.extend([crc, size, size].iter().flat_map(|v| v.to_le_bytes()));

        directory.extend(b"PK\x01\x02\0\0");
        directory.extend(local.iter().flat_map(|v| v.to_le_bytes()));
        directory.extend(crc.to_le_bytes());
        let extra: Vec<u8> = if deviation.wide {
            directory.extend([0xff; 8]);
            let values = [u64::from(size), u64::from(size), u64::from(at)];
            [1u16, 24]
                .iter()
                .flat_map(|v| v.to_le_bytes())
                .chain(values.iter().flat_map(|v| v.to_le_bytes()))
                .collect()
        } else {
            directory.extend([size, size].iter().flat_map(|v| v.to_le_bytes()));
            Vec::new()
        };
        directory.extend((name.len() as u16).to_le_bytes());
        directory.extend((extra.len() as u16).to_le_bytes());
        directory.extend([0; 10]);
        directory.extend(if deviation.wide { u32::MAX } else { at }.to_le_bytes());
        directory.extend(name.as_bytes());
        directory.extend(extra);
    }
    let (start, size, count) = (bytes.len(), directory.len(), entries.len());
    bytes.extend(directory);
    if deviation.wide {
        let record = bytes.len() as u64;
        bytes.extend(b"PK\x06\x06");
        bytes.extend([44u64].iter().flat_map(|v| v.to_le_bytes()));
        bytes.extend([0; 12]);
        bytes.extend([count, count, size, start].iter().flat_map(|&v| (v as u64).to_le_bytes()));
        bytes.extend(b"PK\x06\x07\0\0\0\0");
        bytes.extend(record.to_le_bytes());
        bytes.extend(1u32.to_le_bytes());
    }
    bytes.extend(b"PK\x05\x06\0\0\0\0");
    bytes.extend([count as u16; 2].iter().flat_map(|v| v.to_le_bytes()));
    bytes.extend((size as u32).to_le_bytes());
    bytes.extend(if deviation.wide { u32::MAX } else { start as u32 }.to_le_bytes());
    bytes.extend([0; 2]);
    bytes
}

/// An archive with `pickle` and storages by key.
pub(crate) fn file(pickle: &Pickle, storages: &[(&str, &[u8])]) -> Vec<u8> {
    let names: Vec<String> = storages.iter().map(|(key, _)| format!("data/{key}")).collect();
    let mut entries: Vec<(&str, &[u8])> = vec![("data.pkl", &pickle.0), ("byteorder", b"little")];
    entries.extend(names.iter().zip(storages).map(|(name, (_, data))| (name.as_str(), *data)));
    entries.push(("version", b"3\n"));
    archive(&entries, Deviation::default())
}

fn crc32(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(!0, |crc, &byte| {
        (0..8).fold(crc ^ u32::from(byte), |c, _| if c & 1 == 1 { c >> 1 ^ 0xedb8_8320 } else { c >> 1 })
    })
}

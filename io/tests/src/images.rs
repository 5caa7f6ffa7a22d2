//! Writers of PNG and JPEG without compression: every byte is known, and they share no code with
//! the readers.

/// CRC-32 as in PNG's appendix, bit by bit.
fn crc32(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(!0_u32, |crc, &byte| {
        (0..8).fold(crc ^ u32::from(byte), |c, _| if c & 1 == 1 { c >> 1 ^ 0xedb8_8320 } else { c >> 1 })
    })
}

/// A zlib stream of one stored block.
fn stored(data: &[u8]) -> Vec<u8> {
    let length = u16::try_from(data.len()).unwrap();
    let mut stream = vec![0x78, 0x01, 1];
    stream.extend(length.to_le_bytes());
    stream.extend((!length).to_le_bytes());
    stream.extend(data);
    let (a, b) = data.iter().fold((1_u32, 0_u32), |(a, b), &byte| {
        let a = (a + u32::from(byte)) % 65_521;
        (a, (a + b) % 65_521)
    });
    stream.extend((b << 16 | a).to_be_bytes());
    stream
}

/// A chunk of a PNG.
pub fn chunk(kind: [u8; 4], content: &[u8]) -> Vec<u8> {
    let mut chunk = u32::try_from(content.len()).unwrap().to_be_bytes().to_vec();
    let summed = [&kind, content].concat();
    chunk.extend(&summed);
    chunk.extend(crc32(&summed).to_be_bytes());
    chunk
}

/// Sides, depth, colour type and interlacing, as in IHDR.
pub struct Ihdr {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Bits of a sample.
    pub depth: u8,
    /// The colour type.
    pub colour: u8,
    /// Whether it is interlaced by Adam7.
    pub interlaced: bool,
}

/// A PNG with `between` (whole chunks) before the scanlines `raw`, filter bytes included.
pub fn png_with(ihdr: &Ihdr, between: &[(&[u8; 4], &[u8])], raw: &[u8]) -> Vec<u8> {
    let mut header = [ihdr.width.to_be_bytes(), ihdr.height.to_be_bytes()].concat();
    header.extend([ihdr.depth, ihdr.colour, 0, 0, u8::from(ihdr.interlaced)]);
    let mut file = b"\x89PNG\r\n\x1a\n".to_vec();
    file.extend(chunk(*b"IHDR", &header));
    between.iter().for_each(|(kind, content)| file.extend(chunk(**kind, content)));
    file.extend(chunk(*b"IDAT", &stored(raw)));
    file.extend(chunk(*b"IEND", b""));
    file
}

/// A PNG of `width` x `height` pixels that is not interlaced.
pub fn png(width: u32, height: u32, depth: u8, colour: u8, raw: &[u8]) -> Vec<u8> {
    png_with(&Ihdr { width, height, depth, colour, interlaced: false }, &[], raw)
}

/// A baseline JPEG whose 8 x 8 blocks each have one colour (Y, Cb, Cr): only the mean of a block is
/// coded.
///
/// All quantisers are 1. A mean's difference of `n` bits has the code `n` in 4 bits, the end of a
/// block the code 0 in 1 bit.
pub fn jpeg(width: u16, height: u16, blocks: &[[u8; 3]]) -> Vec<u8> {
    assert_eq!(blocks.len(), usize::from(width.div_ceil(8)) * usize::from(height.div_ceil(8)));
    let segment = |code: u8, content: &[u8]| {
        let length = u16::try_from(content.len() + 2).unwrap().to_be_bytes();
        [&[0xff, code], &length[..], content].concat()
    };
    let [[h1, h0], [w1, w0]] = [height.to_be_bytes(), width.to_be_bytes()];
    let mut file = vec![0xff, 0xd8];
    file.extend(segment(0xdb, &[&[0][..], &[1; 64]].concat()));
    file.extend(segment(0xc0, &[8, h1, h0, w1, w0, 3, 1, 0x11, 0, 2, 0x11, 0, 3, 0x11, 0]));
    let means: Vec<u8> = (0..12).collect();
    file.extend(segment(0xc4, &[&[0, 0, 0, 0, 12], &[0; 12][..], &means].concat()));
    file.extend(segment(0xc4, &[&[0x10, 1], &[0; 15][..], &[0]].concat()));
    file.extend(segment(0xda, &[3, 1, 0, 2, 0, 3, 0, 0, 63, 0]));
    let mut bits = Vec::new();
    let mut last = [128_u8; 3];
    for block in blocks {
        for (value, last) in block.iter().zip(&mut last) {
            let difference = 8 * (i32::from(*value) - i32::from(*last));
            *last = *value;
            let size = 32 - difference.unsigned_abs().leading_zeros();
            let magnitude = if difference < 0 { difference + (1 << size) - 1 } else { difference };
            bits.extend((0..4).rev().map(|bit| size >> bit & 1 == 1));
            bits.extend((0..size).rev().map(|bit| magnitude >> bit & 1 == 1));
            bits.push(false);
        }
    }
    for byte in bits.chunks(8) {
        // The last byte is filled up with ones.
        let byte = (0..8).fold(0, |b, at| b << 1 | u8::from(*byte.get(at).unwrap_or(&true)));
        file.extend(if byte == 0xff { vec![0xff, 0] } else { vec![byte] });
    }
    file.extend([0xff, 0xd9]);
    file
}

/// One small file of each format.
pub fn samples() -> Vec<(&'static str, Vec<u8>)> {
    let interlaced = Ihdr { width: 2, height: 2, depth: 8, colour: 2, interlaced: true };
    vec![
        ("PNG", png(2, 2, 8, 2, &[0, 1, 2, 3, 4, 5, 6, 0, 7, 8, 9, 10, 11, 12])),
        ("interlaced PNG", png_with(&interlaced, &[], &[0, 1, 2, 3, 0, 4, 5, 6, 0, 7, 8, 9, 10, 11, 12])),
        (
            "palette PNG",
            png_with(
                &Ihdr { width: 3, height: 1, depth: 2, colour: 3, interlaced: false },
                &[(b"PLTE", &[1, 2, 3, 4, 5, 6, 7, 8, 9]), (b"tRNS", &[0, 255])],
                &[0, 0b00_01_10_00],
            ),
        ),
        ("JPEG", jpeg(16, 8, &[[200, 128, 128], [76, 85, 255]])),
        ("PPM", b"P6 2 1 255\n\x01\x02\x03\x04\x05\x06".to_vec()),
        ("PGM", b"P5 2 1 65535\n\x01\x02\x03\x04".to_vec()),
    ]
}

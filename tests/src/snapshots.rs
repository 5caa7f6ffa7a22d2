//! Snapshots that were changed on purpose.

/// `bytes`, a snapshot whose content was changed, with length and checksum that fit: FNV-1a over all before it.
pub fn sealed(mut bytes: Vec<u8>) -> Vec<u8> {
    bytes.truncate(bytes.len() - 8);
    let length = (bytes.len() + 8) as u64;
    bytes[16..24].copy_from_slice(&length.to_le_bytes());
    let step = |hash: u64, byte: &u8| (hash ^ u64::from(*byte)).wrapping_mul(0x0000_0100_0000_01b3);
    let checksum = bytes.iter().fold(0xcbf2_9ce4_8422_2325, step);
    bytes.extend(checksum.to_le_bytes());
    bytes
}

//! Cut, unfinished and damaged files are used as far as they are intact.

#![allow(clippy::unwrap_used, reason = "a test")]

mod common;

use common::*;
use std::io::Cursor;
use std::path::Path;
use trocar_recording::messages::{MessageLog, open_reader, realsense};

fn bytes(name: &str) -> Vec<u8> {
    std::fs::read(fixture(name)).unwrap()
}

fn log_of(bytes: Vec<u8>) -> Box<dyn MessageLog> {
    open_reader(Path::new("damaged"), Box::new(Cursor::new(bytes))).unwrap()
}

/// The start of the bag's index section, by its header.
fn index_at(bag: &[u8]) -> (usize, usize) {
    let field = bag.windows(10).position(|w| w == b"index_pos=").unwrap() + 10;
    (field, u64::from_le_bytes(bag[field..field + 8].try_into().unwrap()) as usize)
}

fn all(log: &dyn MessageLog) -> usize {
    log.topics().iter().map(|t| t.count).sum()
}

/// Number of messages of an intact file.
fn whole(name: &str) -> usize {
    all(&*log(name))
}

#[test]
fn a_bag_without_its_end_is_whole() {
    for name in ["realsense.bag", "realsense_bz2.bag", "realsense_lz4.bag", "compressed.bag"] {
        let mut bag = bytes(name);
        let (field, at) = index_at(&bag);
        bag.truncate(at);
        // The header still points to the missing index; then, as in an unfinished bag, nowhere.
        for _ in 0..2 {
            let log = log_of(bag.clone());
            assert_eq!(all(&*log), whole(name), "{name}");
            assert_eq!(read_all(&*log).0, whole(name));
            assert!(log.problems().iter().any(|p| p.contains("no index")), "{:?}", log.problems());
            bag[field..field + 8].fill(0);
        }
    }
}

/// A recorder without any message writes the header alone, which is valid.
#[test]
fn an_empty_bag_is_whole() {
    let mut bag = bytes("realsense.bag");
    let (field, _) = index_at(&bag);
    bag.truncate(13 + 4096);
    let log = log_of(bag.clone());
    assert!(log.topics().is_empty() && log.problems().len() == 1, "{:?}", log.problems());
    let end = bag.len() as u64;
    bag[field..field + 8].copy_from_slice(&end.to_le_bytes());
    let count = bag.windows(12).position(|w| w == b"chunk_count=").unwrap() + 12;
    bag[count..count + 4].fill(0);
    assert_eq!(log_of(bag).problems(), [""; 0]);
}

/// Removes the index records between the chunks too.
#[test]
fn a_bag_without_any_index_is_read_through() {
    for name in ["realsense.bag", "realsense_bz2.bag", "realsense_lz4.bag"] {
        let bag = bytes(name);
        let (_, end) = index_at(&bag);
        let u32_at = |at: usize| u32::from_le_bytes(bag[at..at + 4].try_into().unwrap()) as usize;
        let mut out = bag[..13].to_vec();
        let mut at = 13;
        while at < end {
            let header = u32_at(at);
            let next = at + 8 + header + u32_at(at + 4 + header);
            if !bag[at..at + 8 + header].windows(4).any(|w| w == b"op=\x04") {
                out.extend(&bag[at..next]);
            }
            at = next;
        }
        let log = log_of(out);
        assert_eq!(read_all(&*log).0, whole(name), "{name}");
        assert!(log.problems().iter().any(|p| p.contains("chunks have no index")), "{:?}", log.problems());
        let found = realsense::find(log.topics()).unwrap();
        assert_eq!(pixels(&images(&*log, found.color)[3]), color(3));
    }
}

/// A killed recorder leaves a chunk header of zeros, followed by the chunk's records.
#[test]
fn the_open_chunk_of_a_killed_recorder_is_used() {
    let mut bag = bytes("realsense.bag");
    let (field, end) = index_at(&bag);
    bag.truncate(end);
    bag[field..field + 8].fill(0);
    let chunk = bag.windows(4).rposition(|w| w == b"op=\x05").unwrap();
    // The header's three fields come in any order; its length is in the four bytes before the
    // first.
    let start = (0..chunk).rev().find(|&i| {
        let header = u32::from_le_bytes(bag[i..i + 4].try_into().unwrap()) as usize;
        (20..100).contains(&header) && bag[i + 4..i + 4 + header].windows(5).any(|w| w == b"size=")
    });
    let start = start.unwrap();
    let header = u32::from_le_bytes(bag[start..start + 4].try_into().unwrap()) as usize;
    let data_len = start + 4 + header;
    let len = u32::from_le_bytes(bag[data_len..data_len + 4].try_into().unwrap()) as usize;
    bag.truncate(data_len + 4 + len - 3);
    bag[data_len..data_len + 4].fill(0);
    let log = log_of(bag);
    assert_eq!(read_all(&*log).0, whole("realsense.bag") - 1, "{:?}", log.problems());
}

#[test]
fn an_mcap_file_without_its_end_is_whole() {
    for name in ["ros1.mcap", "ros2_none.mcap", "ros2_zstd.mcap", "ros2_lz4.mcap", "foxglove_protobuf.mcap"] {
        let mut mcap = bytes(name);
        let summary = mcap.len() - 8 - 20;
        let at = u64::from_le_bytes(mcap[summary..summary + 8].try_into().unwrap()) as usize;
        mcap.truncate(at);
        let log = log_of(mcap);
        assert_eq!(read_all(&*log).0, whole(name), "{name}");
        assert!(log.problems().iter().any(|p| p.contains("no footer")), "{:?}", log.problems());
    }
}

#[test]
fn every_cut_keeps_what_is_before_it() {
    for name in ALL {
        let whole_file = bytes(name);
        let mut before = 0;
        for percent in (30..=100).step_by(7) {
            let log = log_of(whole_file[..whole_file.len() * percent / 100].to_vec());
            let (had, decoded) = read_all(&*log);
            assert!(had >= before, "{name}: {had} messages at {percent} %, {before} before");
            assert!(percent == 100 || !log.problems().is_empty(), "{name} at {percent} %");
            // The messages that are returned are correct.
            if let Some(t) = log.topics().iter().position(|t| t.name.ends_with("Color_0/image/data")) {
                for (f, image) in images(&*log, t).iter().enumerate() {
                    assert_eq!(pixels(image), color(f));
                }
            }
            assert!(decoded > 0 || had < 3, "{name} at {percent} %: {had} messages, none decoded");
            before = had;
        }
        assert!(before > whole(name) / 2, "{name}: only {before} of {} before the end", whole(name));
    }
}

/// A damaged chunk costs its own messages, one error each, and no others.
#[test]
fn a_damaged_chunk_costs_its_messages() {
    for (name, magic) in [
        ("realsense_bz2.bag", &b"BZh9"[..]),
        ("realsense_lz4.bag", &0x184d_2204u32.to_le_bytes()),
        ("ros2_lz4.mcap", &0x184d_2204u32.to_le_bytes()),
        ("ros2_zstd.mcap", &0xfd2f_b528u32.to_le_bytes()),
    ] {
        let mut file = bytes(name);
        let chunk = file.windows(4).enumerate().filter(|(_, w)| *w == magic).nth(3).unwrap().0;
        file[chunk + 60..chunk + 90].fill(0xA5);
        let log = log_of(file);
        assert_eq!(all(&*log), whole(name), "{name}");
        let wanted: Vec<_> =
            (0..log.topics().len()).flat_map(|t| (0..log.times(t).len()).map(move |i| (t, i))).collect();
        let lost: Vec<String> = log.messages(&wanted).filter_map(|m| m.bytes.err()).map(|e| e.to_string()).collect();
        assert!((1..=4).contains(&lost.len()), "{name}: {lost:?}");
        assert!(lost.iter().all(|e| e.contains("damaged") && e.contains("message ")), "{lost:?}");
    }
}

/// A wrong length ends the walk from chunk to chunk; the end of the file says where to continue.
#[test]
fn a_damaged_length_costs_a_chunk() {
    for (name, op) in [("realsense.bag", &b"op=\x05"[..]), ("realsense_lz4.bag", b"op=\x05")] {
        let mut file = bytes(name);
        let at = file.windows(4).enumerate().filter(|(_, w)| *w == op).nth(2).unwrap().0;
        let start =
            (0..at).rev().find(|&i| file[i..i + 4] == [file[i], 0, 0, 0] && (at - i) < 60 && file[i] > 30).unwrap();
        let data_len = start + 4 + usize::from(file[start]);
        file[data_len..data_len + 4].fill(0xFF);
        let log = log_of(file);
        let had = read_all(&*log).0;
        assert!(
            had + 6 >= whole(name) && (had < whole(name)) == name.contains("lz4"),
            "{name}: {had} of {}",
            whole(name)
        );
        assert!(log.problems().iter().any(|p| p.contains("are lost")), "{:?}", log.problems());
    }
    let mut file = bytes("ros2_none.mcap");
    let summary = file.len() - 28;
    let end = u64::from_le_bytes(file[summary..summary + 8].try_into().unwrap()) as usize;
    // The third chunk record, by walking.
    let (mut at, mut chunks) = (8, 0);
    while at < end {
        let len = u64::from_le_bytes(file[at + 1..at + 9].try_into().unwrap()) as usize;
        chunks += usize::from(file[at] == 6);
        if chunks == 3 {
            break;
        }
        at += 9 + len;
    }
    file[at + 5] = 1;
    let log = log_of(file);
    let (had, all) = (read_all(&*log).0, whole("ros2_none.mcap"));
    assert_eq!(had, all, "an uncompressed chunk is found all the same: {:?}", log.problems());
    assert!(!log.problems().is_empty());
}

/// Zstandard frames of 600 bytes that decompress to 16 MiB each: opening stops and reports it.
#[test]
fn chunks_that_grow_without_end_are_not_followed() {
    const BLOCKS: u32 = 128;
    let mut frame = 0xfd2f_b528u32.to_le_bytes().to_vec();
    frame.push(0xA0);
    frame.extend((BLOCKS << 17).to_le_bytes());
    for block in 1..=BLOCKS {
        // A block of 128 KiB of the same byte; the last is marked.
        let header = (1 << 20) | 2 | u32::from(block == BLOCKS);
        frame.extend(&header.to_le_bytes()[..3]);
        frame.push(0);
    }
    let mut file = b"\x89MCAP0\r\n".to_vec();
    for _ in 0..2000 {
        let mut chunk = vec![0; 16];
        chunk.extend(u64::from(BLOCKS << 17).to_le_bytes());
        chunk.extend([0, 0, 0, 0, 4, 0, 0, 0]);
        chunk.extend(b"zstd");
        chunk.extend((frame.len() as u64).to_le_bytes());
        chunk.extend(&frame);
        file.push(6);
        file.extend((chunk.len() as u64).to_le_bytes());
        file.extend(chunk);
    }
    let start = std::time::Instant::now();
    let log = log_of(file);
    assert!(log.problems().iter().any(|p| p.contains("not read through")), "{:?}", log.problems());
    assert!(!log.problems().iter().any(|p| p.contains("damaged")), "{:?}", log.problems());
    assert!(start.elapsed().as_secs() < 5, "{:?}", start.elapsed());
}

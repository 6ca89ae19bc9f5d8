//! Damaged messages give a value or an error of one line. Messages with huge sizes in their headers
//! allocate nothing.
#![allow(clippy::unwrap_used, reason = "tests")]

mod common;

use common::{actions, after_request, array, endpoint, floats, linger, observation, text};
use std::io::Write;
use std::sync::Mutex;
use trocar_remote::{Client, Error, ReplyLimits, Value, pack, unpack};
use trocar_testing::{Allowance, PEAK, Peak, fuzz_reader};

#[global_allocator]
static ALLOCATOR: &Peak = &PEAK;

/// Memory is counted for all threads together, so one test runs at a time.
static ALONE: Mutex<()> = Mutex::new(());

/// An empty list of one byte becomes a value of 64 bytes.
const ALLOWANCE: Allowance = Allowance { fixed: 1 << 20, per_byte: 300 };

#[test]
fn damage_never_panics() {
    let _alone = ALONE.lock().unwrap();
    let seeds = [
        ("observation".to_owned(), pack(&observation()).unwrap()),
        ("reply".to_owned(), actions(array(text("<f4"), &[4, 3], &floats(&[0.5; 12])))),
    ];
    let mut refused = 0;
    fuzz_reader(&seeds, ALLOWANCE, |_, bytes| {
        let outcome = unpack(bytes).and_then(|value| {
            if let Value::Map(map) = &value {
                let packed = pack(map).unwrap();
                let Value::Map(again) = unpack(&packed).unwrap() else { panic!("no map") };
                assert_eq!(pack(&again).unwrap(), packed);
            }
            ReplyLimits::default().take(&value)
        });
        if let Err(e) = outcome {
            let line = e.to_string();
            assert!(!line.contains('\n') && line.len() < 1500, "{line}");
            refused += 1;
        }
    });
    assert!(refused > 100, "{refused}");
}

#[test]
fn sizes_in_headers_are_not_allocated() {
    let _alone = ALONE.lock().unwrap();
    // A frame of 1 TB; one of 2^63 - 1 bytes; 1,000 fragments of 64 KiB, which are 64 MB in all.
    let terabyte = [&[0x82, 127][..], &(1u64 << 40).to_be_bytes()].concat();
    let largest = [&[0x82, 127][..], &(u64::MAX >> 1).to_be_bytes()].concat();
    for (head, fragments) in [(terabyte, 0), (largest, 0), (Vec::new(), 1000)] {
        let server = after_request(move |mut socket| {
            socket.get_mut().write_all(&head).unwrap();
            let fragment = [&[0x00, 127][..], &65536u64.to_be_bytes(), &[0; 65536]].concat();
            for i in 0..fragments {
                let mut fragment = fragment.clone();
                fragment[0] = if i == 0 { 0x02 } else { 0x00 };
                if socket.get_mut().write_all(&fragment).is_err() {
                    return;
                }
            }
            linger(&mut socket);
        });
        let mut endpoint = endpoint(&server.url);
        endpoint.max_message = 4 << 20;
        endpoint.timeouts.infer = std::time::Duration::from_secs(5);
        let mut client = Client::connect(&endpoint).unwrap();
        PEAK.start();
        let e = client.infer(&observation()).unwrap_err();
        let peak = PEAK.since_start();
        assert!(matches!(e, Error::TooLarge { size, limit, .. } if size > limit && limit == 4 << 20), "{e}");
        assert!(peak < 20 << 20, "{peak} bytes");
    }
}

//! Messages: a round trip, and an error for each kind of damage.
#![allow(clippy::unwrap_used, reason = "tests")]

mod common;

use common::{actions, array, bin, floats, map, observation, text};
use proptest::prelude::*;
use trocar_remote::{Actions, Array, Dtype, Error, Map, ReplyLimits, Result, ServerConfig, Value, pack, unpack};

#[test]
fn messages_survive_a_round_trip() {
    let observation = observation();
    assert_eq!(unpack(&pack(&observation).unwrap()).unwrap(), Value::Map(observation));
}

fn values() -> impl Strategy<Value = Value> {
    let leaf = prop_oneof![
        Just(Value::Nil),
        any::<bool>().prop_map(Value::Bool),
        any::<i64>().prop_map(Value::Int),
        (-1e300..1e300).prop_map(Value::Float),
        ".{0,40}".prop_map(Value::Text),
        prop::collection::vec(any::<u8>(), 0..300).prop_map(Value::Bytes),
        (0usize..4, 0usize..5).prop_flat_map(|(a, b)| {
            prop::collection::vec(-1e9f64..1e9, a * b)
                .prop_map(move |v| Value::Array(Array::from_f64(&[a, b], &v).unwrap()))
        }),
    ];
    leaf.prop_recursive(4, 64, 20, |inner| {
        prop_oneof![
            prop::collection::vec(inner.clone(), 0..20).prop_map(Value::List),
            prop::collection::btree_map("[a-z/]{0,12}", inner, 0..20).prop_map(Value::Map),
        ]
    })
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(300) })]
    #[test]
    fn any_message_survives_a_round_trip(value in values()) {
        let message = Map::from([("value".to_owned(), value)]);
        prop_assert_eq!(unpack(&pack(&message).unwrap()).unwrap(), Value::Map(message));
    }
}

/// The actions of a reply with the given limits.
fn taken(reply: &[u8], limits: ReplyLimits) -> Result<Actions> {
    unpack(reply).and_then(|reply| limits.take(&reply))
}

fn named(e: &Error) -> String {
    let line = e.to_string();
    assert!(!line.contains('\n'), "{line}");
    let debug = format!("{e:?}");
    debug.split([' ', '{']).next().unwrap().to_owned()
}

#[test]
fn chunks_may_have_every_type_of_number() {
    let limits = ReplyLimits { dim: Some(2), max_horizon: 2 };
    let types: [(&str, Vec<u8>); 8] = [
        ("<f4", floats(&[1.0, -2.0, 3.0, 4.0])),
        (">f4", [1.0f32, -2.0, 3.0, 4.0].iter().flat_map(|v| v.to_be_bytes()).collect()),
        ("<f8", [1.0f64, -2.0, 3.0, 4.0].iter().flat_map(|v| v.to_le_bytes()).collect()),
        (">i8", [1i64, -2, 3, 4].iter().flat_map(|v| v.to_be_bytes()).collect()),
        ("<i2", [1i16, -2, 3, 4].iter().flat_map(|v| v.to_le_bytes()).collect()),
        ("<i4", [1i32, -2, 3, 4].iter().flat_map(|v| v.to_le_bytes()).collect()),
        ("|i1", vec![1, 0xfe, 3, 4]),
        ("<f2", [0x3c00u16, 0xc000, 0x4200, 0x4400].iter().flat_map(|v| v.to_le_bytes()).collect()),
    ];
    for (dtype, data) in types {
        let chunk = taken(&actions(array(text(dtype), &[2, 2], &data)), limits).unwrap();
        assert_eq!(chunk.values(), [1.0, -2.0, 3.0, 4.0], "{dtype}");
        assert_eq!(chunk.step(1).unwrap(), [3.0, 4.0]);
        assert_eq!(chunk.step(2), None);
    }
    // Older RoboArena servers send only the array.
    assert_eq!(taken(&array(text("<f4"), &[1, 2], &floats(&[5.0, 6.0])), limits).unwrap().values(), [5.0, 6.0]);
}

#[test]
fn invalid_chunks_are_refused() {
    let limits = ReplyLimits { dim: Some(2), max_horizon: 2 };
    let float = |shape: &[u8], values: &[f32]| actions(array(text("<f4"), shape, &floats(values)));
    let cases: [(&str, Vec<u8>); 21] = [
        ("NotFinite", float(&[1, 2], &[0.0, f32::NAN])),
        ("NotFinite", float(&[1, 2], &[f32::INFINITY, 0.0])),
        ("NotFinite", actions(array(text("<f2"), &[1, 2], &[0, 0x7c, 0, 0]))),
        ("WrongDimension", float(&[1, 3], &[0.0; 3])),
        ("EmptyChunk", float(&[0, 2], &[])),
        ("EmptyChunk", float(&[1, 0], &[])),
        ("LongChunk", float(&[3, 2], &[0.0; 6])),
        ("WrongField", float(&[2], &[0.0; 2])),
        ("WrongField", float(&[1, 1, 2], &[0.0; 2])),
        ("WrongField", float(&[], &[0.0])),
        ("WrongField", actions(vec![0x92, 1, 2])),
        ("WrongField", map(&[(text("action"), array(text("<f4"), &[1, 2], &floats(&[0.0; 2])))])),
        ("WrongField", vec![0xc0]),
        ("WrongShape", float(&[1, 2], &[0.0; 3])),
        ("WrongShape", actions(array(text("<f8"), &[1, 2], &[0; 8]))),
        ("WrongDtype", actions(array(text("|b1"), &[1, 2], &[0, 1]))),
        ("WrongDtype", actions(array(text("|O"), &[1, 2], b"\x80\x04\x95pickle"))),
        ("WrongDtype", actions(array(text("<c8"), &[1, 1], &[0; 8]))),
        ("WrongDtype", actions(array(text("<U1"), &[1, 2], &[0; 8]))),
        ("WrongDtype", actions(array(text("<M8[ns]"), &[1, 1], &[0; 8]))),
        ("Malformed", actions(array(vec![0x91, 0x92, 0xa1, b'a', 0xa3, b'<', b'f', b'4'], &[1, 1], &[0; 4]))),
    ];
    for (expected, reply) in cases {
        assert_eq!(named(&taken(&reply, limits).unwrap_err()), expected, "{reply:x?}");
    }
}

#[test]
fn invalid_messages_are_refused() {
    let half = |key: &str, value: Vec<u8>| map(&[(bin(b"__ndarray__"), vec![0xc3]), (bin(key.as_bytes()), value)]);
    let cases: Vec<(&str, Vec<u8>)> = vec![
        ("Malformed", vec![]),
        ("Malformed", vec![0xc1]),
        ("Malformed", vec![0xc0, 0xc0]),
        ("Malformed", vec![0xa5, b'a']),
        ("Malformed", vec![0xa2, 0xc3, 0x28]),
        // Sizes of 4 GiB in the header.
        ("Malformed", vec![0xdb, 0xff, 0xff, 0xff, 0xff]),
        ("Malformed", vec![0xc6, 0xff, 0xff, 0xff, 0xff]),
        ("Malformed", vec![0xdd, 0xff, 0xff, 0xff, 0xff]),
        ("Malformed", vec![0xdf, 0xff, 0xff, 0xff, 0xff]),
        // An extension, a timestamp.
        ("Malformed", vec![0xd4, 5, 0]),
        ("Malformed", vec![0xd6, 0xff, 0, 0, 0, 0]),
        ("Malformed", vec![0xcf, 0x80, 0, 0, 0, 0, 0, 0, 0]),
        // Keys: a number, not UTF-8, a duplicate.
        ("Malformed", vec![0x81, 1, 1]),
        ("Malformed", vec![0x81, 0xc4, 1, 0xff, 1]),
        ("Malformed", vec![0x82, 0xa1, b'a', 1, 0xa1, b'a', 2]),
        // Arrays with missing parts, of other packages, with text keys.
        ("Malformed", half("data", bin(&[]))),
        ("Malformed", half("dtype", text("<f4"))),
        ("Malformed", map(&[(bin(b"nd"), vec![0xc3]), (bin(b"type"), text("<f4"))])),
        ("Malformed", map(&[(text("__ndarray__"), vec![0xc3])])),
        ("Malformed", map(&[(bin(b"__npgeneric__"), vec![0xc3]), (bin(b"dtype"), text("<f4"))])),
        ("Malformed", array(text("<f4"), &[0xff], &[])),
        ("WrongShape", array(text("<f8"), &[0x7f; 12], &[])),
        ("TooDeep", [vec![0x91; 100_000], vec![0xc0]].concat()),
        ("TooDeep", [b"\x81\xa1a".repeat(10_000), vec![0xc0]].concat()),
        ("TooMany", [vec![0xdd, 0, 1, 0x86, 0xa0], vec![0xc0; 100_000]].concat()),
        ("TooMany", [vec![0x92], [&[0xdc, 0xff, 0xff][..], &[0xc0; 65_535]].concat().repeat(2)].concat()),
    ];
    for (expected, bytes) in cases {
        let found = unpack(&bytes).map(|v| format!("{v:?}")).map_err(|e| named(&e));
        assert_eq!(found, Err(expected.to_owned()), "{:x?}", &bytes[..bytes.len().min(40)]);
    }
}

#[test]
fn numpy_numbers_are_numbers() {
    let number = |dtype: &str, value: Vec<u8>| {
        unpack(&map(&[(bin(b"__npgeneric__"), vec![0xc3]), (bin(b"data"), value), (bin(b"dtype"), text(dtype))]))
            .unwrap()
    };
    assert_eq!(number("<i4", vec![0xfe]), Value::Int(-2));
    assert_eq!(number("<f4", vec![0xca, 0x3f, 0, 0, 0]), Value::Float(0.5));
    assert_eq!(number("|b1", vec![0xc3]), Value::Bool(true));
    assert_eq!(number("<U2", text("up")), Value::Text("up".into()));
    assert_eq!(
        unpack(&array(text("<f4"), &[], &floats(&[0.5]))).unwrap(),
        Value::Array(Array::new(Dtype::F32, &[], floats(&[0.5])).unwrap())
    );
}

#[test]
fn roboarena_metadata_are_read() {
    let resolution = Value::List(vec![180.into(), 320.into()]);
    let mut metadata = Map::from([
        ("image_resolution".to_owned(), resolution),
        ("needs_wrist_camera".to_owned(), true.into()),
        ("n_external_cameras".to_owned(), 2.into()),
        ("action_space".to_owned(), "cartesian_position".into()),
    ]);
    assert!(ServerConfig::is_in(&metadata) && !ServerConfig::is_in(&Map::new()));
    let config = ServerConfig::from_metadata(&metadata).unwrap();
    assert_eq!(config.image_resolution, Some([180, 320]));
    assert_eq!((config.n_external_cameras, config.needs_stereo_camera, config.action_dim()), (2, false, Some(7)));
    metadata.insert("image_resolution".into(), Value::Nil);
    assert_eq!(ServerConfig::from_metadata(&metadata).unwrap().image_resolution, None);
    for (key, bad) in
        [("image_resolution", Value::from(224)), ("n_external_cameras", 3.into()), ("needs_wrist_camera", 1.into())]
    {
        let mut metadata = metadata.clone();
        metadata.insert(key.into(), bad);
        let e = ServerConfig::from_metadata(&metadata).unwrap_err();
        assert!(matches!(&e, Error::WrongField { at, .. } if at == key), "{e}");
    }
}

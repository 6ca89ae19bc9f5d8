//! A viewer of an episode that this program steps: clients see every state, change nothing, and are
//! answered while the program stands still.

#![allow(clippy::unwrap_used, reason = "tests may panic")]

use serde_json::json;
use std::time::Duration;
use trocar_task::{Episode, policy};
use trocar_testing::tube::{ONE_END, resection, two_tubes};
use trocar_view::Follower;
use trocar_view::client::{Client, Received};

const SECONDS: Duration = Duration::from_secs(60);

/// The hashes of the first steps of the scripted policy; `look` sees the episode at its start and
/// after each.
fn hashes(episode: &mut Episode, seed: u64, mut look: impl FnMut(&Episode)) -> Vec<u64> {
    episode.reset(seed).unwrap();
    let mut scripted = policy::named("scripted").unwrap();
    scripted.begin(episode, seed).unwrap();
    look(episode);
    let mut all = Vec::new();
    while all.len() < 40 {
        for action in scripted.act(episode).unwrap() {
            episode.step(&action).unwrap();
            all.push(episode.state_hash());
            look(episode);
        }
    }
    all
}

#[test]
fn clients_watch_what_another_program_steps_and_change_none_of_its_bits() {
    let mut scene = resection();
    scene.cameras.retain(|camera| camera.name == "endoscope");
    let mut episode = Episode::new(&scene, &two_tubes(ONE_END, 3e-3), 1).unwrap();
    let plain = hashes(&mut episode, 3, |_| {});

    let mut follower = Follower::start("tube", &episode, 0).unwrap();
    assert!(follower.address().starts_with("http://127.0.0.1:") && follower.address().contains("?token="));
    let mut client = Client::connect(&follower.wire()).unwrap();
    let hello = client.wait(SECONDS, |m| m.kind() == "hello").unwrap().header;
    assert_eq!(hello["source"]["kind"], "environment");
    // Nothing steps; the state is there all the same.
    let at_rest = client.wait(SECONDS, |m| m.kind() == "frame").unwrap().header;
    assert_eq!((&at_rest["step"], at_rest["organs"].as_array().unwrap().len()), (&json!(plain.len()), 2));
    for refused in [json!({"type": "seats", "take": ["controls"]}), json!({"type": "pause"})] {
        let why = client.ask(refused, 1).unwrap_err().to_string();
        assert!(why.contains("clients watch"), "{why}");
    }
    client.ask(json!({"type": "subscribe", "frames_hz": 240, "value": "stretch", "measured_hz": 60}), 2).unwrap();
    client.send(&json!({"type": "picture", "camera": "endoscope", "width": 32, "height": 18, "request": 3})).unwrap();

    let mut fresh = true;
    let watched = hashes(&mut episode, 3, |episode| {
        follower.see(episode, std::mem::take(&mut fresh)).unwrap();
    });
    assert_eq!(watched, plain, "a viewer changes what is simulated");
    // The last state comes, however fast the steps were, and all that is asked for.
    let (mut frames, mut measured, mut picture) = (0, 0, None);
    let last = |m: &Received| m.kind() == "frame" && m.header["step"] == plain.len();
    let got = client.wait(SECONDS, |m| {
        frames += u32::from(m.kind() == "frame");
        measured += u32::from(m.kind() == "measured");
        if m.header["request"] == 3 {
            picture = Some(m.header.clone());
        }
        last(m) && frames > 1
    });
    let got = got.unwrap().header;
    assert!(frames > 2 && measured > 0 && got["actors"]["left"] == "environment", "{frames} {measured} {got}");
    let picture = picture.unwrap_or_else(|| client.wait(SECONDS, |m| m.header["request"] == 3).unwrap().header);
    assert_eq!(picture["type"], "picture", "{picture}");
    let history = client.ask(json!({"type": "history", "channels": ["lift_mm"], "from_s": 0}), 4).unwrap().header;
    assert_eq!(history["arrays"]["rows"]["shape"], json!([plain.len(), 1]));
    drop(follower);
    assert!(client.wait(SECONDS, |_| false).is_err(), "the connection has ended");
}

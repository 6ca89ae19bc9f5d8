"""Campaigns give the same bits here, on threads, and on Ray's workers."""

import os

import pytest
from trocar import campaign

OPTIONS = {"episodes": 2, "seed": 5}
POLICIES = ["scripted", "random"]


@pytest.fixture(scope="module")
def local(short_scene, tmp_path_factory):
    folder = tmp_path_factory.mktemp("campaign")
    return folder, campaign.run(str(short_scene), POLICIES, folder / "local", workers=2, **OPTIONS)


def test_threads_keep_every_episode_and_go_on(short_scene, local):
    folder, result = local
    assert result["episodes"] == result["planned"] == 4 and [p["episodes"] for p in result["policies"]] == [2, 2]
    assert (folder / "local/report.html").exists() and (folder / "local/table.csv").exists()
    # With everything there, nothing is run; with one episode gone, one is, to the same bits.
    gone = folder / "local/episodes/random/000001"
    for file in gone.iterdir():
        file.unlink()
    gone.rmdir()
    done = []
    again = campaign.run(
        str(short_scene), POLICIES, folder / "local", workers=1, progress=lambda *n: done.append(n), **OPTIONS
    )
    assert done == [(1, 1)] and again["hash"] == result["hash"]
    with pytest.raises(ValueError, match="another seed"):
        campaign.run(str(short_scene), POLICIES, folder / "local", episodes=2, seed=6)


def test_ray_gives_the_same_bits_though_a_worker_is_lost(short_scene, local, monkeypatch):
    pytest.importorskip("ray", reason="Ray is not installed")
    folder, result = local
    mark = folder / "lost"

    class Mortal(campaign._Actor):
        """Its first process dies amid an episode."""

        def run(self, job):
            if not mark.exists():
                mark.touch()
                os._exit(1)
            return super().run(job)

    monkeypatch.setattr(campaign, "_Actor", Mortal)
    done = []
    options = {"workers": 2, "ray_address": "local", "progress": lambda *n: done.append(n), **OPTIONS}
    far = campaign.run(str(short_scene), POLICIES, folder / "far", **options)
    assert mark.exists() and far["hash"] == result["hash"] and done[-1] == (4, 4)
    for kept in sorted((folder / "local/episodes").rglob("episode.trocar")):
        other = folder / "far" / kept.relative_to(folder / "local")
        assert kept.read_bytes() == other.read_bytes()
        assert kept.with_name("result.json").read_text() == other.with_name("result.json").read_text()

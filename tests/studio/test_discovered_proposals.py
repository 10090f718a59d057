"""Proposals that `kineme discover` stored, in the studio: with their names, accepted and rejected as others."""

from __future__ import annotations

import pytest

from kineme.library.discover import discover, store_discovery
from kineme.library.library import ActionLibrary
from kineme.recognition.recognizer import Recognizer
from work_samples import work_episodes


@pytest.fixture(scope="module")
def discovered(tmp_path_factory):
    episodes, _ = work_episodes(6, tasks=("pick the cube",))
    folder = tmp_path_factory.mktemp("discovered") / "actions"
    with ActionLibrary(folder, create=True, recognizer=Recognizer(translation=False, scale="none")) as library:
        store_discovery(library.store, episodes, discovery := discover(episodes))
    return folder, [kind.name for kind in discovery.kinds]


def test_proposals_have_the_names_that_tasks_propose(discovered, open_studio):
    folder, names = discovered
    client = open_studio(folder)
    proposals = client.get("/api/proposals").json()["proposals"]
    assert [proposal["name"] for proposal in proposals] == names
    accepted = client.post(f"/api/proposals/{proposals[0]['id']}/accept", json={"name": names[0]})
    assert accepted.status_code == 200
    assert client.post(f"/api/proposals/{proposals[1]['id']}/reject").status_code == 200
    assert [proposal["name"] for proposal in client.get("/api/proposals").json()["proposals"]] == names[2:]
    changes = client.get("/api/library/history").json()
    assert f"Proposed {len(names)} kinds of" in str(changes)

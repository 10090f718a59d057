"""
Draw in the studio with a hand before the camera
================================================

MediaPipe finds the hand in each picture, and its 21 landmarks go to the studio, which shows them in *Draw*: while thumb
and index finger touch, the tip of the index finger draws. Needs ``pip install mediapipe websockets``, and MediaPipe's
model ``hand_landmarker.task``, which its pages offer. Put the token of the address that ``kineme studio`` prints into
``KINEME_STUDIO_TOKEN``: ``python examples/camera_hand.py hand_landmarker.task 127.0.0.1:8420``.
"""

from __future__ import annotations

import json
import os
import sys
import time
from collections.abc import Iterator
from typing import Any

import cv2
import mediapipe as mp
from mediapipe.tasks.python import BaseOptions, vision
from websockets.sync.client import connect

ESCAPE = 27  # key that ends the program


def seen_hands(model: str) -> Iterator[dict[str, Any]]:
    """Yield the landmarks of a hand in pictures of the first camera, as the studio takes them, until Escape."""
    video = vision.RunningMode.VIDEO
    options = vision.HandLandmarkerOptions(base_options=BaseOptions(model_asset_path=model), running_mode=video)
    camera = cv2.VideoCapture(0)
    with vision.HandLandmarker.create_from_options(options) as landmarker:
        while cv2.waitKey(1) != ESCAPE:
            is_there, picture = camera.read()
            if not is_there:
                return
            now = time.monotonic()
            picture = cv2.flip(picture, 1)  # as in a mirror: the hand goes where the drawing goes
            cv2.imshow("Escape ends", picture)
            height, width = picture.shape[:2]
            image = mp.Image(image_format=mp.ImageFormat.SRGB, data=cv2.cvtColor(picture, cv2.COLOR_BGR2RGB))
            for hand in landmarker.detect_for_video(image, round(1000 * now)).hand_landmarks[:1]:
                points = [[point.x, point.y, point.z] for point in hand]
                yield {"points": points, "time": now, "aspect": width / height}


def main(model: str, host: str) -> None:
    """Send what the camera sees to the studio."""
    header = {"Authorization": "Bearer " + os.environ["KINEME_STUDIO_TOKEN"]}
    with connect(f"ws://{host}/api/live", additional_headers=header) as studio:
        studio.send(json.dumps({"name": "camera"}))
        for hand in seen_hands(model):
            studio.send(json.dumps({"hand": hand}))


if __name__ == "__main__":
    main(*sys.argv[1:])

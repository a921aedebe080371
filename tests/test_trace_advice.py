import logging

import shenron_rt as srt
from shenron_rt.tracing import advice


def warned(caplog, **post):
    advice._advised.clear()
    caplog.clear()
    with caplog.at_level(logging.WARNING, logger="shenron_rt"):
        scene = srt.Scene(static=[{"name": "post", "id": 9, "shape": "pole:h=3,r=0.05", **post}])
        for frame in range(2):
            srt.trace(scene, frame=frame, rays=20_000)
    return [r.getMessage() for r in caplog.records if "post" in r.getMessage()]


def test_an_object_thinner_than_a_ray_is_named_once(caplog):
    # 20 000 rays of this pattern are 17 mrad apart: 0.5 m at 30 m, five times the post
    (message,) = warned(caplog, xyz_m=(32, 0, 0))
    assert "id 9" in message
    assert "aim" in message


def test_aimed_near_and_unlit_objects_need_no_advice(caplog):
    assert not warned(caplog, xyz_m=(32, 0, 0), aim=500)
    assert not warned(caplog, xyz_m=(5, 0, 0))
    assert not warned(caplog, xyz_m=(2, 0, 300))


def test_a_forest_of_thin_objects_gets_a_few_lines(caplog):
    advice._advised.clear()
    posts = [{"name": f"post {k}", "id": k, "shape": "pole:h=3,r=0.05", "xyz_m": (32, k - 10, 0)} for k in range(1, 20)]
    with caplog.at_level(logging.WARNING, logger="shenron_rt"):
        srt.trace(srt.Scene(static=posts), rays=20_000)
    lines = [r.getMessage() for r in caplog.records]
    assert [line.split("'")[1] for line in lines] == [*(f"post {k}" for k in range(1, 6)), "post 19"]
    assert "14 more objects" in lines[-1]

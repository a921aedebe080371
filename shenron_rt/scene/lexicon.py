"""Words in names of objects, materials and files, and the tag or material they stand for.

Names are cut into words at separators, CamelCase humps and digits, and only whole words match: ``StreetLight`` holds
no tree, ``Carpet`` no car, ``Bush`` no bus. The longest phrase wins (``guard rail`` over ``rail``), and of equally long
ones the last, because the last noun of an English compound is its head (``RailTrain`` is a train).

The vehicle models are those of CARLA's blueprint library 0.9.14 to 0.10. Where CARLA documents no tag for a prop, its
description of Static ("immovable": hydrants, benches, fountains, bus stops) and Dynamic ("may be moved": bins, bags,
cones) decides. Vans count as cars, as CARLA files its parked Volkswagen T2.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from typing import TypeVar

from ..tags import SemanticTag as Tag

__all__ = ["find_material", "find_tag", "is_whole_phrase", "split_words"]

_TAG_PHRASES: dict[Tag, str] = {
    Tag.Roads: (
        "road, street, lane, driving lane, highway, motorway, asphalt, crosswalk, cross walk, zebra crossing, "
        "junction, intersection, parking lot, parking lane, bus lane, bike lane, driveway, drive way, road surface"
    ),
    Tag.Sidewalks: "side walk, curb, kerb, gutter, pavement, foot path, footpath, walkway, curb stone, kerb stone",
    Tag.RoadLines: "road line, road marking, lane mark, lane marking, lane line, road mark",
    Tag.Buildings: (
        "building, house, apartment, gas station, petrol station, awning, office, sky scraper, skyscraper, garage, "
        "shop, mall, hotel, church, school, hospital, warehouse, facade, roof, tower block, car park building, guard "
        "house, tree house, chimney, balcony, farm house, barn, shed, hangar, house wall, building wall, water tower, "
        "train station, bus station, fire station, police station, terraced house"
    ),
    Tag.Walls: "wall, retaining wall, sound wall, noise barrier, sound barrier, brick wall",
    Tag.Fences: "fence, chain link fence, railing, hand rail, picket fence, gate",
    Tag.Poles: (
        "pole, lamp post, street light, street lamp, light pole, lamp pole, traffic light pole, traffic pole, traffic "
        "sign pole, sign pole, sign post, signal post, signal pole, signal mast, utility pole, telephone pole, power "
        "pole, electric pole, flag pole, bollard, post, traffic light post, street light pole, lamp, road lamp"
    ),
    Tag.TrafficLight: "traffic light, stop light, traffic signal, signal head, semaphore, traffic light box",
    Tag.TrafficSigns: (
        "traffic sign, stop sign, yield sign, road sign, speed sign, speed limit, speed limit sign, sign, street "
        "sign, give way, highway sign, direction sign, no entry"
    ),
    Tag.Vegetation: (
        "tree, bush, hedge, shrub, foliage, leaf, leaves, plant, vegetation, maple, oak, pine, birch, palm, fir, "
        "spruce, cypress, acacia, beech, elm, poplar, willow, cedar, sycamore, eucalyptus, magnolia, olive tree, "
        "acer, quercus, pinus, betula, platanus, tilia, fagus, populus, ulmus, salix, fraxinus, juniper, ivy, flower, "
        "fern, coconut palm, sassafras, aporosa tree, japanese maple, tree wall, tree trunk, tree line"
    ),
    Tag.Terrain: "terrain, grass, landscape, lawn, meadow, hill, road grass, soil, dirt, sand",
    Tag.Sky: "sky, sky box, sky sphere, sky dome, bp sky",
    Tag.Pedestrians: "pedestrian, walker, person, human, man, woman, child, people, human body",
    Tag.Rider: "rider, cyclist, motorcyclist, biker",
    Tag.Car: (
        "car, hatchback, sedan, suv, coupe, van, minivan, mini van, microbus, pickup, pick up, pickup truck, taxi, "
        "cab, jeep, wrangler, automobile, vehicle, police car, sports car, convertible, tesla, model 3, tesla m 3, "
        "cyber cab, audi, audi tt, audi a 2, etron, e tron, bmw, grand tourer, chevrolet, impala, citroen, citroen c "
        "3, dodge, dodge charger, charger, charger parked, police charger, charger cop, mercedes, sprinter, mercedes "
        "ccc, ford crown, ford mustang, mustang, crown victoria, lincoln, mkz, lincoln mkz, mini cooper, cooper s, "
        "microlino, nissan, micra, nissan patrol, patrol 2021, patrol, toyota, prius, toyota prius, seat leon, "
        "volkswagen, volkswagen t 2, polestar, jeep wrangler, rubicon, ambulance, parked car, renault, peugeot, opel, "
        "skoda, hyundai, honda civic, volvo, porsche, ferrari"
    ),
    Tag.Truck: (
        "truck, fire truck, lorry, european hgv, hgv, carla cola, cola truck, cyber truck, trailer, semi trailer, "
        "milk truck, garbage truck, box truck, tractor trailer, dump truck, tanker truck"
    ),
    Tag.Bus: "bus, coach, city bus, school bus, fusorosa, fuso rosa, fuso, double decker, trolley bus, buses",
    Tag.Train: "train, tram, locomotive, rail train, subway, metro, railcar, rail car, train wagon",
    Tag.Motorcycle: (
        "motorcycle, motorbike, motor bike, motor cycle, scooter, moped, vespa, yamaha, yzf, kawasaki, kawasaki "
        "ninja, harley, harley davidson, low rider, zx 125"
    ),
    Tag.Bicycle: (
        "bicycle, bike, road bike, cross bike, cycle, diamondback century, diamondback, gazelle, omafiets, mountain "
        "bike"
    ),
    Tag.Static: (
        "bus stop, bus shelter, bench, fire hydrant, hydrant, fountain, street fountain, mail box, mailbox, kiosk, "
        "vending machine, atm, advertisement, bill board, billboard, phone booth, manhole, bike rack, bike stand, "
        "pergola, planter, plant pot, flower pot, play ground, parking meter, transformer, electric box, charging "
        "station, charger station, ev charger, truck stop, antenna, statue, power line, electric line, pillar, column"
    ),
    Tag.Dynamic: (
        "barrel, drum, traffic cone, construction cone, cone, trash can, trash bag, trash bin, trash, bin, garbage, "
        "garbage can, garbage bag, dumpster, crate, pallet, chair, table, shopping cart, shopping trolley, trolley, "
        "suitcase, briefcase, travel case, guitar case, wheel chair, wheelchair, stroller, street barrier, "
        "construction barrier, chain barrier, barricade, warning construction, warning accident, traffic warning, "
        "animal, dog, cat, deer, plastic bag, shopping bag, creased box, container, debris, water barrel, "
        "construction barrel, barbeque, gnome, hay bale"
    ),
    Tag.Water: "water, river, lake, pond, sea, ocean, canal",
    Tag.Ground: "ground, floor, ground plane",
    Tag.Bridge: "bridge, bridge pillar, bridge column, bridge deck, overpass, over pass, viaduct, foot bridge",
    Tag.RailTrack: "rail track, rail way, railway, railroad, rail road, rail, train track, tram track",
    Tag.GuardRail: (
        "guard rail, jersey barrier, crash barrier, w beam, concrete barrier, safety barrier, road barrier, barrier, "
        "highway barrier, guard rails"
    ),
    Tag.Rock: "rock, stone, boulder, cliff",
}

_MATERIAL_PHRASES: dict[str, str] = {
    "metal": "metal, steel, iron, aluminium, aluminum, chrome, copper, galvanised, galvanized, tin, brass, corrugated",
    "car_paint": "car paint, carpaint, body paint, vehicle paint, car body",
    "glass": "glass, window, windshield, wind shield, windscreen, wind screen, glazing",
    "plastic": "plastic, bumper, polymer, pvc, abs, polycarbonate",
    "rubber": "rubber, tire, tyre, wheel",
    "asphalt": "asphalt, tarmac, bitumen",
    "concrete": "concrete, cement, plaster, stucco",
    "brick": "brick, masonry",
    "wood": "wood, timber, plywood, chipboard, floorboard, plank",
    "vegetation": "vegetation, leaf, leaves, foliage, tree",
    "grass": "grass, lawn",
    "plasterboard": "plasterboard, plaster board, drywall",
    "acrylic": "acrylic, plexiglass, plexiglas, lamp cover, headlight, tail light",
    "gravel": "gravel, ballast",
    "trunk": "trunk, bark, tree trunk",
    "soil": "soil, dirt, mud, sand, very dry ground, medium dry ground, wet ground",
    "skin": "skin, flesh",
    "clothing": "clothing, clothes, cloth, fabric, textile",
}

# Object names that say what a piece is made of although its tag says something else.
_PIECES = {"tire", "tyre", "wind shield", "windshield", "wind screen", "windscreen", "window glass", "bumper"}

_T = TypeVar("_T", Tag, str)
_WORD = re.compile(r"[A-Z]+(?=[A-Z][a-z])|[A-Z]?[a-z]+|[A-Z]+|\d+")
_LONGEST = 6  # words that a phrase can be spread over


def split_words(name: str) -> list[str]:
    """Return the words of a name in lower case.

    Examples
    --------
    >>> split_words("SM_TrafficLightPole_02"), split_words("audiTT")
    (['sm', 'traffic', 'light', 'pole', '02'], ['audi', 'tt'])
    """
    return [w.lower() for w in _WORD.findall(name)]


def _plurals(phrase: str) -> Iterable[str]:
    yield phrase
    if phrase[-1].isalpha() and not phrase.endswith("s"):
        yield phrase + ("es" if phrase.endswith(("x", "ch", "sh")) else "s")


def _table(phrases: Mapping[_T, str]) -> dict[str, tuple[_T, int, str]]:
    """Return squeezed phrase -> (meaning, number of words, phrase)."""
    table: dict[str, tuple[_T, int, str]] = {}
    for meaning, listed in phrases.items():
        for phrase in (p.strip() for p in listed.split(",")):
            for form in _plurals(phrase):
                table.setdefault(form.replace(" ", ""), (meaning, len(form.split()), phrase))
    return table


_TAGS = _table(_TAG_PHRASES)
_MATERIALS = _table(_MATERIAL_PHRASES)


def _best(words: Sequence[str], table: Mapping[str, tuple[_T, int, str]]) -> tuple[_T, str] | None:
    best: tuple[int, int] | None = None
    found: tuple[_T, str] | None = None
    for start in range(len(words)):
        for stop in range(start + 1, min(start + _LONGEST, len(words)) + 1):
            hit = table.get("".join(words[start:stop]))
            # A one-word phrase must be one word of the name: "Bus_H" is no bush.
            if hit is None or (hit[1] == 1 and stop - start > 1):
                continue
            rank = (hit[1], stop)
            if best is None or rank >= best:
                best, found = rank, (hit[0], hit[2])
    return found


def find_tag(name: str) -> tuple[Tag, str] | None:
    """Return the tag a name's words stand for, and the phrase; None where no phrase occurs."""
    return _best(split_words(name), _TAGS)


def find_material(name: str, *, pieces_only: bool = False) -> tuple[str, str] | None:
    """Return the material a name's words stand for, and the phrase; None where no phrase occurs.

    Parameters
    ----------
    name : str
    pieces_only : bool
        Take only words that say what an object is made of whatever its tag is (tyre, windscreen): for object names.
    """
    hit = _best(split_words(name), _MATERIALS)
    if hit is None or (pieces_only and hit[1] not in _PIECES):
        return None
    return hit


def is_whole_phrase(name: str) -> Tag | None:
    """Return the tag where the name is one phrase and nothing else, as a folder ``Poles`` or ``traffic_signs``."""
    words = [w for w in split_words(name) if not w.isdigit()]
    hit = _TAGS.get("".join(words))
    return None if hit is None or (hit[1] == 1 and len(words) > 1) else hit[0]

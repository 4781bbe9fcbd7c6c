"""The contract itself: one key a topic, the numberings of the seeds, the spellings clients see."""

from __future__ import annotations

import re
from collections import Counter

from rackhand.schemas.crf import CrfCode
from rackhand.schemas.fail_reasons import MoveFailReason
from rackhand.schemas.service import ServiceId
from rackhand.schemas.topics import QUERIES, TOPICS, Query, Topic


def test_names_and_keys_are_unique_and_under_one_roof() -> None:
    rows: list[Topic | Query] = [*TOPICS, *QUERIES]
    assert not [name for name, n in Counter(row.name for row in rows).items() if n > 1]
    assert not [key for key, n in Counter(row.key for row in rows).items() if n > 1]
    for row in rows:
        assert re.fullmatch(r"rackhand/(world|\{robot\})(/[a-z_]+){1,2}", row.key)


def test_every_row_of_the_table_is_listed() -> None:
    from rackhand.schemas import topics

    listed = {id(row) for row in (*TOPICS, *QUERIES)}
    assert all(id(v) in listed for v in vars(topics).values() if isinstance(v, Topic | Query))


def test_the_fail_reasons_are_those_of_the_move_api() -> None:
    """Numbers and documentation names of seed 000, which the project must not change."""
    documented = {
        2: "GetMapFailed", 3: "StartingPointOutOfMap", 4: "EndingPointOutOfMap", 5: "StartingPointNotInGround",
        6: "EndingPointNotInGround", 7: "StartingEqualEnding", 8: "CalculateGlobalPathExtendedDataError",
        9: "CalculationFailed", 10: "CalculationTimeout", 11: "NoGlobalPath", 12: "NotGrabStartIndexOnGlobalPath",
        13: "NotGrabEndIndexOnGlobalPath", 14: "PlanningTimeout", 15: "MoveTimeout", 16: "ControlCostmapError",
        17: "PowerCableConnected", 18: "RotateTimeout", 100: "ChargeRetryCountExceeded",
        101: "ChargeDockDetectionError", 102: "ChargeDockSignalError", 103: "InvalidChargeDock",
        104: "AlreadyInCharging", 105: "NoChargeCurrent", 200: "InvalidCabinetPos", 201: "CabinetDetectionError",
        202: "NoDockWithConveyer", 203: "NoApproachConveyer", 300: "ElevatorPointOccupied", 301: "ElevatorClosed",
        302: "ElevatorPointObscuredTimeout", 303: "ElevatorPointOccupancyDetectionTimeout",
        304: "ElevatorEnterProgressUpdateTimeout", 400: "InvalidTrackPoints", 401: "TooFarFromStartOfTrack",
        500: "InvalidRackDetectionPos", 501: "RackDetectionError", 502: "RackRetryCountExceeded",
        503: "UnloadPointOccupied", 504: "UnloadPointUnreachable", 505: "RackMoved", 506: "JackInUpState",
        507: "InvalidRackAreaId", 508: "InvalidRackArea", 509: "UnknownRackSpaceState", 510: "NoRackInRackArea",
        511: "AlignFailedInRackArea", 512: "NoFreeSpaceInRackArea", 513: "FailedToUnloadInRackArea",
        600: "FollowFailed", 700: "PoiDetectionError", 701: "PoiUnreachable", 702: "BarcodeDetectionError",
        1000: "PlatformAlertError", 1001: "ServiceCallError", 1002: "InternalError", 1003: "MapChanged",
        1004: "MoveActionTypeDeprecated", 0: "none", 1: "unknown",
    }  # fmt: skip
    assert {number: MoveFailReason(number).doc_name for number in documented} == documented


def test_fail_reasons_are_spelt_as_measured() -> None:
    assert MoveFailReason.NONE.rest_string == "None - None"
    assert MoveFailReason.NONE.topic_string == "none"
    assert MoveFailReason.RACK_DETECTION_ERROR.rest_string == "rack_detection_error - 未识别到货架"
    assert MoveFailReason.RACK_DETECTION_ERROR.topic_string == "MoveFailReason::rack_detection_error"
    assert all(reason.text for reason in MoveFailReason)


def test_crf_codes_are_those_of_the_framework() -> None:
    assert CrfCode.ConnectionWatchdog is CrfCode.RequestToDeviceFailed
    assert (CrfCode.Empty, CrfCode.OK, CrfCode.Forbidden, CrfCode.NotImplemented) == (0, 200, 403, 501)
    assert (CrfCode.RealTimeViolation, CrfCode.WorkspaceViolation, CrfCode.UR_Violation) == (800, 804, 2117)
    assert 803 not in set(CrfCode)


def test_a_service_is_found_by_its_token() -> None:
    service = ServiceId("planner", "amr1")
    assert ServiceId.from_key(service.key) == service
    assert str(service) == "amr1/planner"

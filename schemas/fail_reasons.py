"""Why a move failed: the ``MoveFailReason`` of the Move API (seed 000), spelt as clients see it."""

from __future__ import annotations

from enum import IntEnum


class MoveFailReason(IntEnum):
    """Numbers and names as on the wire; never mixed with ``CrfCode``.

    19-21, 514-517, 601 and 1005 are newer than the seeds and known from the public SDK.
    """

    NONE = 0
    UNKNOWN = 1
    GET_MAP_FAILED = 2
    STARTING_POINT_OUT_OF_MAP = 3
    ENDING_POINT_OUT_OF_MAP = 4
    STARTING_POINT_NOT_IN_GROUND = 5
    ENDING_POINT_NOT_IN_GROUND = 6
    STARTING_EQUAL_ENDING = 7
    CALCULATE_GLOBAL_PATH_EXTENDED_DATA_ERROR = 8
    CALCULATION_FAILED = 9
    CALCULATION_TIMEOUT = 10
    NO_GLOBAL_PATH = 11
    NOT_GRAB_START_INDEX_ON_GLOBAL_PATH = 12
    NOT_GRAB_END_INDEX_ON_GLOBAL_PATH = 13
    PLANNING_TIMEOUT = 14
    MOVE_TIMEOUT = 15
    CONTROL_COSTMAP_ERROR = 16
    POWER_CABLE_CONNECTED = 17
    ROTATE_TIMEOUT = 18
    ENDING_POINT_NOT_SIGNIFICANTLY_CHANGED = 19
    ENDING_POINT_APPROACHING = 20
    ENDING_POINT_NOT_SPECIFIED = 21
    CHARGE_RETRY_COUNT_EXCEEDED = 100
    CHARGE_DOCK_DETECTION_ERROR = 101
    CHARGE_DOCK_SIGNAL_ERROR = 102
    INVALID_CHARGE_DOCK = 103
    ALREADY_IN_CHARGING = 104
    NO_CHARGE_CURRENT = 105
    INVALID_CABINET_POS = 200
    CABINET_DETECTION_ERROR = 201
    NO_DOCK_WITH_CONVEYER = 202
    NO_APPROACH_CONVEYER = 203
    ELEVATOR_POINT_OCCUPIED = 300
    ELEVATOR_CLOSED = 301
    ELEVATOR_POINT_OBSCURED_TIMEOUT = 302
    ELEVATOR_POINT_OCCUPANCY_DETECTION_TIMEOUT = 303
    ELEVATOR_ENTER_PROGRESS_UPDATE_TIMEOUT = 304
    INVALID_TRACK_POINTS = 400
    TOO_FAR_FROM_START_OF_TRACK = 401
    INVALID_RACK_DETECTION_POS = 500
    RACK_DETECTION_ERROR = 501
    RACK_RETRY_COUNT_EXCEEDED = 502
    UNLOAD_POINT_OCCUPIED = 503
    UNLOAD_POINT_UNREACHABLE = 504
    RACK_MOVED = 505
    JACK_IN_UP_STATE = 506
    INVALID_RACK_AREA_ID = 507
    INVALID_RACK_AREA = 508
    UNKNOWN_RACK_SPACE_STATE = 509
    NO_RACK_IN_RACK_AREA = 510
    ALIGN_FAILED_IN_RACK_AREA = 511
    NO_FREE_SPACE_IN_RACK_AREA = 512
    FAILED_TO_UNLOAD_IN_RACK_AREA = 513
    RACK_SUBTYPE_INCOMPATIBLE = 514
    TOWING_HOOK_IN_LOCKED_STATE = 515
    CARGO_READY_LIMIT_SWITCH_FAULT = 516
    CARGO_READY_NOT_TRIGGERED = 517
    FOLLOW_FAILED = 600
    FOLLOW_PATH_TOO_CIRCUITOUS = 601
    POI_DETECTION_ERROR = 700
    POI_UNREACHABLE = 701
    BARCODE_DETECTION_ERROR = 702
    PLATFORM_ALERT_ERROR = 1000
    SERVICE_CALL_ERROR = 1001
    INTERNAL_ERROR = 1002
    MAP_CHANGED = 1003
    MOVE_ACTION_TYPE_DEPRECATED = 1004
    CONFIGURATION_ERROR = 1005

    @property
    def rest_name(self) -> str:
        """The snake_case name of ``fail_reason_str``."""
        return self.name.lower()

    @property
    def doc_name(self) -> str:
        """The PascalCase name of the API's documentation; 0 and 1 are written small there."""
        return self.rest_name if self in (self.NONE, self.UNKNOWN) else self.rest_name.title().replace("_", "")

    @property
    def text(self) -> str:
        """The Chinese text after the name in ``fail_reason_str``."""
        return _TEXTS[self]

    @property
    def rest_string(self) -> str:
        """``fail_reason_str`` of REST: ``"rack_detection_error - 未识别到货架"``, ``"None - None"`` when fine."""
        return "None - None" if self is MoveFailReason.NONE else f"{self.rest_name} - {self.text}"

    @property
    def topic_string(self) -> str:
        """``fail_reason_str`` as in ``/planning_state``."""
        return "none" if self is MoveFailReason.NONE else f"MoveFailReason::{self.rest_name}"


_TEXTS = {
    MoveFailReason.NONE: "无",
    MoveFailReason.UNKNOWN: "未知原因",
    MoveFailReason.GET_MAP_FAILED: "获取地图失败",
    MoveFailReason.STARTING_POINT_OUT_OF_MAP: "起点在地图外",
    MoveFailReason.ENDING_POINT_OUT_OF_MAP: "终点在地图外",
    MoveFailReason.STARTING_POINT_NOT_IN_GROUND: "起点不在可通行区域",
    MoveFailReason.ENDING_POINT_NOT_IN_GROUND: "终点不在可通行区域",
    MoveFailReason.STARTING_EQUAL_ENDING: "起点与终点相同",
    MoveFailReason.CALCULATE_GLOBAL_PATH_EXTENDED_DATA_ERROR: "全局路径附加数据计算失败",
    MoveFailReason.CALCULATION_FAILED: "道路不连通",
    MoveFailReason.CALCULATION_TIMEOUT: "路径计算超时",
    MoveFailReason.NO_GLOBAL_PATH: "无全局路径",
    MoveFailReason.NOT_GRAB_START_INDEX_ON_GLOBAL_PATH: "全局路径上找不到起点",
    MoveFailReason.NOT_GRAB_END_INDEX_ON_GLOBAL_PATH: "全局路径上找不到终点",
    MoveFailReason.PLANNING_TIMEOUT: "长时间无法规划路径",
    MoveFailReason.MOVE_TIMEOUT: "路径规划成功但移动超时",
    MoveFailReason.CONTROL_COSTMAP_ERROR: "局部避障地图数据异常",
    MoveFailReason.POWER_CABLE_CONNECTED: "正在使用电源线充电",
    MoveFailReason.ROTATE_TIMEOUT: "旋转超时",
    MoveFailReason.ENDING_POINT_NOT_SIGNIFICANTLY_CHANGED: "终点无明显变化",
    MoveFailReason.ENDING_POINT_APPROACHING: "即将到达终点",
    MoveFailReason.ENDING_POINT_NOT_SPECIFIED: "未指定终点",
    MoveFailReason.CHARGE_RETRY_COUNT_EXCEEDED: "充电重试次数超限",
    MoveFailReason.CHARGE_DOCK_DETECTION_ERROR: "未识别到充电桩",
    MoveFailReason.CHARGE_DOCK_SIGNAL_ERROR: "未收到充电桩对接信号",
    MoveFailReason.INVALID_CHARGE_DOCK: "充电桩位置无效",
    MoveFailReason.ALREADY_IN_CHARGING: "已在充电中",
    MoveFailReason.NO_CHARGE_CURRENT: "接触后长时间无充电电流",
    MoveFailReason.INVALID_CABINET_POS: "货柜位置无效",
    MoveFailReason.CABINET_DETECTION_ERROR: "未识别到货柜",
    MoveFailReason.NO_DOCK_WITH_CONVEYER: "当前未与传送带对接",
    MoveFailReason.NO_APPROACH_CONVEYER: "当前未接近传送带",
    MoveFailReason.ELEVATOR_POINT_OCCUPIED: "电梯点被占用",
    MoveFailReason.ELEVATOR_CLOSED: "电梯门已关闭",
    MoveFailReason.ELEVATOR_POINT_OBSCURED_TIMEOUT: "电梯点长时间被遮挡",
    MoveFailReason.ELEVATOR_POINT_OCCUPANCY_DETECTION_TIMEOUT: "电梯点占用检测超时",
    MoveFailReason.ELEVATOR_ENTER_PROGRESS_UPDATE_TIMEOUT: "进入电梯长时间无进展",
    MoveFailReason.INVALID_TRACK_POINTS: "路线点无效",
    MoveFailReason.TOO_FAR_FROM_START_OF_TRACK: "距离路线起点过远",
    MoveFailReason.INVALID_RACK_DETECTION_POS: "货架识别点无效",
    MoveFailReason.RACK_DETECTION_ERROR: "未识别到货架",
    MoveFailReason.RACK_RETRY_COUNT_EXCEEDED: "货架对接重试次数超限",
    MoveFailReason.UNLOAD_POINT_OCCUPIED: "卸货点被占用",
    MoveFailReason.UNLOAD_POINT_UNREACHABLE: "卸货点不可达",
    MoveFailReason.RACK_MOVED: "货架明显移动",
    MoveFailReason.JACK_IN_UP_STATE: "顶升处于升起状态",
    MoveFailReason.INVALID_RACK_AREA_ID: "货架区编号无效",
    MoveFailReason.INVALID_RACK_AREA: "货架区无货架点",
    MoveFailReason.UNKNOWN_RACK_SPACE_STATE: "货架位状态未知",
    MoveFailReason.NO_RACK_IN_RACK_AREA: "货架区内没有货架",
    MoveFailReason.ALIGN_FAILED_IN_RACK_AREA: "货架区内对接失败",
    MoveFailReason.NO_FREE_SPACE_IN_RACK_AREA: "货架区没有空位",
    MoveFailReason.FAILED_TO_UNLOAD_IN_RACK_AREA: "货架区内卸货失败",
    MoveFailReason.RACK_SUBTYPE_INCOMPATIBLE: "货架类型不兼容",
    MoveFailReason.TOWING_HOOK_IN_LOCKED_STATE: "牵引钩处于锁定状态",
    MoveFailReason.CARGO_READY_LIMIT_SWITCH_FAULT: "货物到位开关故障",
    MoveFailReason.CARGO_READY_NOT_TRIGGERED: "货物未到位",
    MoveFailReason.FOLLOW_FAILED: "跟随目标丢失",
    MoveFailReason.FOLLOW_PATH_TOO_CIRCUITOUS: "跟随路径过于迂回",
    MoveFailReason.POI_DETECTION_ERROR: "兴趣点识别失败",
    MoveFailReason.POI_UNREACHABLE: "兴趣点不可达",
    MoveFailReason.BARCODE_DETECTION_ERROR: "条码识别失败",
    MoveFailReason.PLATFORM_ALERT_ERROR: "系统异常",
    MoveFailReason.SERVICE_CALL_ERROR: "服务调用失败",
    MoveFailReason.INTERNAL_ERROR: "内部错误",
    MoveFailReason.MAP_CHANGED: "任务期间地图变更",
    MoveFailReason.MOVE_ACTION_TYPE_DEPRECATED: "接口已弃用",
    MoveFailReason.CONFIGURATION_ERROR: "配置错误",
}

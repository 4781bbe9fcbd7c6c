"""The chassis API as its documentation lists it: every endpoint and topic, and what this cell makes of each.

``works``: served. ``none``: this kind of chassis has no such thing, and the answer says so with the status given. Tests
compare the table with the application; the gateway serves the rows of ``none`` from it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True)
class Endpoint:
    """One method of one path. ``status``: of the answer where there is no such thing; 0 for one that works."""

    method: str
    path: str
    text: str
    status: Literal[0, 400, 404] = 0

    @property
    def works(self) -> bool:
        return self.status == 0


@dataclass(frozen=True)
class DocumentedTopic:
    """A WebSocket topic. ``missing``: why this cell has no source for it; it can be enabled and stays silent. Empty for
    one that works."""

    name: str
    direction: Literal["sent", "taken"]
    missing: str = ""

    @property
    def works(self) -> bool:
        return not self.missing


def _works(path: str, *methods: str, text: str = "") -> tuple[Endpoint, ...]:
    return tuple(Endpoint(method, path, text) for method in methods)


def _none(status: Literal[400, 404], text: str, *calls: str) -> tuple[Endpoint, ...]:
    """``calls``: as in ``"POST /services/load_cargo"``."""
    split = (call.split() for call in calls)
    return tuple(Endpoint(method, path, text, status) for method, path in split)


def _services(text: str, *names: str) -> tuple[Endpoint, ...]:
    return _none(400, text, *(f"POST /services/{name}" for name in names))


# Services that end an error which this chassis does not have: there is never one to end, so they are done at once.
NOTHING_TO_CLEAR = (
    "wheel_control/clear_errors",
    "clear_slipping_error",
    "monitor/clear_slipping_error",
    "monitor/clear_flip_error",
    "monitor_recheck_errors",
    "clear_fall_risk_warning",
    "clear_system_down_unexpectedly",
    "clear_range_data_all_zero_error",
    "wake_up_device",
)

ENDPOINTS: tuple[Endpoint, ...] = (
    *_works("/chassis/moves", "GET", "POST", "DELETE"),
    *_works("/chassis/moves/{id}", "GET", "PATCH"),
    *_works("/chassis/moves/current", "GET", "PATCH"),
    *_works("/chassis/moves/latest", "GET", text="an alias of the newest move"),
    *_works("/chassis/moves/{id}/explain", "GET", text="an extension"),
    *_works("/chassis/moves/{id}/explain/download", "GET", text="an extension"),
    *_works("/chassis/moves/{id}/explain/download.rrd", "GET", text="an extension; needs the viewer"),
    *_works("/chassis/current-map", "GET", "POST"),
    *_works("/chassis/pose", "GET", "POST"),
    *_works("/chassis/status", "GET"),
    *_works("/chassis/jack", "GET", text="an extension"),
    *_none(400, "deprecated; use /services/wheel_control/set_control_mode", "PATCH /chassis/status"),
    *_works("/maps", "GET", "POST", "DELETE"),
    *_works("/maps/{id}", "GET", "PATCH", "PUT", "DELETE"),
    *_works("/maps/{id}.png", "GET"),
    *_works("/maps/{id}.pbstream", "GET", text="as it was given in carto_map, not read"),
    *_works("/maps/{id}/thumbnail", "GET"),
    *_works("/maps/{id}/download", "GET"),
    *_works("/ros/map/overlays", "GET", "PUT"),
    *_works("/ros/map/traffic_info", "GET", "PUT", text="zones without time_rules"),
    *_works("/mappings", "GET", "POST", "DELETE"),
    *_works("/mappings/{id}", "GET", "DELETE"),
    *_works("/mappings/current", "GET", "PATCH"),
    *_works("/mappings/{id}.png", "GET"),
    *_works("/mappings/{id}/thumbnail", "GET"),
    *_works("/mappings/{id}/trajectories.json", "GET"),
    *_none(404, "a mapping run here makes an occupancy grid alone", "GET /mappings/{id}.pbstream",
           "GET /mappings/{id}/download", "GET /mappings/{id}/landmarks.json", "GET /mappings/{id}/properties.json"),
    *_works("/services/jack_up", "POST"),
    *_works("/services/jack_down", "POST"),
    *_works("/services/jack_self_check", "POST"),
    *_works("/services/clear_jack_errors", "POST"),
    *_works("/services/start_rack_size_detection", "POST"),
    *_works("/services/stop_rack_size_detection", "POST"),
    *_works("/services/wheel_control/set_control_mode", "POST"),
    *_works("/services/wheel_control/set_emergency_stop", "POST"),
    *_works("/services/wheel_control/set_emergency_stop_pressed", "POST"),
    *_works("/services/query_pose/rack_pose", "GET"),
    *_works("/services/query_pose/charger_pose", "GET"),
    *(row for name in NOTHING_TO_CLEAR
      for row in _works(f"/services/{name}", "POST", text="there is no such error, so it is done at once")),
    *_services("this chassis has no cargo rollers or belts", "load_cargo", "unload_cargo", "roller_load",
               "roller_unload"),
    *_services("this chassis has no towing hook", "towing_hook_lock", "towing_hook_release",
               "clear_towing_hook_error"),
    *_services("the wheels of this chassis need no reset and cannot be released by software",
               "wheel_control/reset_wheels", "baseboard/reset_wheel", "confirm_estop"),
    *_services("the processes of a cell are started and stopped by its supervisor", "baseboard/shutdown",
               "restart_service", "restart_py_axbot"),
    *_services("the IMU of this chassis needs no calibration", "imu/recalibrate", "imu/calibrate_gyro_scale"),
    *_services("the localiser finds the pose by itself; POST /chassis/pose gives it a first guess",
               "start_global_positioning", "enable_auto_mapping"),
    *_services("the costmap forgets what is gone by itself", "occupancy_grid_server/reset"),
    *_services("this chassis has no cameras", "get_rgb_image", "calibrate_depth_cameras",
               "calibrate_depth_camera_masks", "depth_camera/enable_cameras"),
    *_services("this chassis has one lidar, with a known place", "calibrate_duo_lidar_poses", "calibrate_lidar_yaws",
               "baseboard/power_on_lidar"),
    *_services("there is no picture of the route; /map and /path have it as data", "get_nav_thumbnail"),
    *_services("the clock of a cell is that of its driver", "step_time"),
    *_none(404, "the clock of a cell is that of its driver", "GET /services/step_time"),
    *_services("this chassis has no Wi-Fi", "setup_wifi", "test_network_speed"),
    *_services("routes are part of a move: along_given_route", "set_route_mode"),
    *_services("this chassis has no USB devices", "reset_usb_devices"),
    *_services("the gateway writes nothing to disk", "clean_disk"),
    *_services("landmarks are not supported", "start_collecting_landmarks", "stop_collecting_landmarks"),
    *_services("this chassis has no V2X receiver", "probe_v2x_beacons"),
    *_none(404, "nothing of that kind is detected by this chassis", "GET /services/query_pose/pallet_pose",
           "GET /services/query_pose/trailer_pose"),
    *_works("/device/info", "GET"),
    *_works("/device/info/brief", "GET"),
    *_works("/device/boot_progress", "GET"),
    *_none(404, "this chassis has no Wi-Fi", "GET /device/available_wifis", "GET /device/wifi_info"),
    *_none(404, "this chassis has no USB devices", "GET /device/usb_devices", "GET /device/usb_devices/saved"),
    *_none(404, "the clock of a cell is that of its driver", "GET /device/chrony/sources",
           "GET /device/chrony/tracking"),
    *_none(404, "sensors are described by /device/info", "GET /device/sensors"),
    *_none(404, "parameters are those of /system/settings", "GET /device/params/dev", "GET /device/params/prod"),
    *_works("/system/settings/schema", "GET"),
    *_works("/system/settings/default", "GET"),
    *_works("/system/settings/user", "GET", "POST", "PATCH"),
    *_works("/system/settings/effective", "GET"),
    *_works("/robot-params", "GET", "POST"),
    *_works("/robot-params/default", "GET"),
    *_works("/world/faults", "GET", "POST", text="an extension, of a simulated world"),
    *_works("/hostnames", "GET", text="always empty"),
    *_none(400, "the names of this machine are not changed over the API", "PATCH /hostnames/{name}"),
    *_none(404, "error: not found", "GET /hostnames/{name}", "DELETE /hostnames/{name}"),
    *_works("/bags", "GET", text="always empty: the viewer records (`rackhand record FILE`)"),
    *_works("/recording", "GET", text="always empty: the viewer records (`rackhand record FILE`)"),
    *_none(400, "recordings are made by the viewer: rackhand record FILE", "POST /recording"),
    *_none(404, "recordings are made by the viewer: rackhand record FILE", "GET /bags/{name}/download",
           "DELETE /recording/{id}"),
    *_none(404, "this chassis has no cameras", "GET /videos", "GET /rgb_cameras"),
    *_none(404, "this chassis has no Bluetooth", "POST /bluetooth/connect", "POST /bluetooth/disconnect"),
    *_none(404, "core dumps are those of the operating system", "GET /core_dumps"),
    *_none(404, "nothing is collected", "GET /collected_data"),
    *_none(404, "software is installed by the operator", "GET /app_store/jobs", "GET /app_store/packages"),
    *_none(404, "this chassis has no Wi-Fi", "GET /wifi_setup"),
    *_none(404, "this version keeps no submaps", "GET /submaps"),
    *_none(404, "this cell has no ROS", "GET /ros/rosmaster/topics", "GET /ros/rosmaster/topics/published_names",
           "POST /ros/imu/clear_gyro_scale", "POST /ros/jack_mast/calibrate_mast_tick_base"),
    *_works("/static-files/{name}", "GET"),
)  # fmt: skip


def _sent(*names: str) -> tuple[DocumentedTopic, ...]:
    return tuple(DocumentedTopic(name, "sent") for name in names)


def _silent(missing: str, *names: str) -> tuple[DocumentedTopic, ...]:
    return tuple(DocumentedTopic(name, "sent", missing) for name in names)


TOPICS: tuple[DocumentedTopic, ...] = (
    DocumentedTopic("/twist", "taken"),
    DocumentedTopic("/follow_target_state", "taken"),
    DocumentedTopic("/get_device_info_brief", "taken"),
    DocumentedTopic("/bluetooth/inbound", "taken", "no Bluetooth"),
    DocumentedTopic("/set_output_pins", "taken", "no output pins"),
    DocumentedTopic("/modify_output_pins", "taken", "no output pins"),
    DocumentedTopic("/external_rgb_data/{name}", "taken", "no cameras"),
    *_sent("/planning_state", "/jack_state", "/robot_model", "/robot/footprint", "/detected_rack",
           "/detected_rack_states", "/map_rack_states", "/tracked_pose", "/slam/state", "/map", "/map_v2",
           "/map/costmap_v2", "/map/info", "/path", "/battery_state", "/wheel_state", "/chassis_state",
           "/motion_metrics", "/alerts", "/scan_matched_points2", "/maps/5cm/1hz", "/local_path",
           "/detailed_battery_state", "/fused_sensor_state", "/sensor_manager_state", "/bumper_state",
           "/platform_monitor/travelled_distance", "/horizontal_laser_2d/matched", "/trajectory"),
    *_silent("no rollers", "/roller_state"),
    *_silent("no towing hook", "/towing_state", "/detected_trailer"),
    *_silent("no forks or mast", "/detected_pallets", "/mast_state"),
    *_silent("no push handle", "/push_handle_state"),
    *_silent("chargers and gates are not detected outside a move", "/detected_features/chargers",
             "/detected_features/gates"),
    *_silent("one costmap is published, in the cells of the map", "/maps/1cm/1hz"),
    *_silent("maps are not built incrementally", "/incremental_map", "/incremental_map_v2", "/updated_map_slice",
             "/env_match_map", "/env_symmetry_map"),
    *_silent("no global positioning", "/global_positioning_state"),
    *_silent("no barcodes or landmarks", "/collected_barcode", "/landmarks"),
    *_silent("no submaps", "/submap_list", "/constraint_list"),
    *_silent("no lidar odometry", "/odom_state"),
    *_silent("raw measurements of the IMU are on the bus: chassis/imu", "/imu_state"),
    *_silent("no lamps", "/robot_signal"),
    *_silent("no calibrations", "/action"),
    *_silent("no input or output pins", "/raw_io_board_state", "/io_pins_state"),
    *_silent("no V2X receiver", "/v2x_health_state"),
    *_silent("no satellite receiver", "/devpvt"),
    *_silent("no mobile network", "/mobile_network_state"),
    *_silent("no Bluetooth", "/bluetooth/outbound", "/bluetooth_state"),
    *_silent("one lidar", "/left_laser_2d/matched", "/right_laser_2d/matched", "/lt_laser_2d/matched",
             "/rb_laser_2d/matched"),
    *_silent("raw scans are on the bus: chassis/scan", "/horizontal_laser_2d/scan"),
    *_silent("no cameras", "/matched_depth_points/{dir}", "/depth_camera/{dir}/points2", "/depth_camera/{dir}/image",
             "/semantic_points", "/rgb_cameras/front/video", "/rgb_cameras/back/video",
             "/rgb_cameras/front_augmented/video", "/rgb_cameras/front/compressed", "/rgb_cameras/back/compressed",
             "/vision_detected_objects", "/external_rgb_camera_control"),
    *_silent("other robots are seen as moving obstacles", "/nearby_robots", "/nearby_robot_footprints"),
    *_silent("no automatic doors", "/nearby_auto_doors"),
)  # fmt: skip

"""Codes of the CRF motion protocol (spec motion-controller §3.3). Never mixed with ``MoveFailReason``."""

from __future__ import annotations

from enum import IntEnum


class CrfCode(IntEnum):
    """Names and numbers as on the wire. 506-510 have CRF's meaning, not HTTP's.

    The vendor ranges 2300-2324 (Kinova) and 3100-3128 (Vicon) have no published names and travel as bare numbers."""

    Empty = 0
    Continue = 100
    SwitchingProtocols = 101
    OK = 200
    Created = 201
    Accepted = 202
    NonAuthoritativeInformation = 203
    NoContent = 204
    ResetContent = 205
    PartialContent = 206
    MultipleChoices = 300
    MovedPermanently = 301
    Found = 302
    SeeOther = 303
    NotModified = 304
    UseProxy = 305
    Unused1 = 306
    TemporaryRedirect = 307
    PermanentRedirect = 308
    BadRequest = 400
    Unauthorized = 401
    PaymentRequired = 402
    Forbidden = 403
    NotFound = 404
    MethodNotAllowed = 405
    NotAcceptable = 406
    ProxyAuthenticationRequired = 407
    RequestTimeout = 408
    Conflict = 409
    Gone = 410
    LengthRequired = 411
    PreconditionFailed = 412
    ContentTooLarge = 413
    URITooLong = 414
    UnsupportedMediaType = 415
    RangeNotSatisfiable = 416
    ExpectationFailed = 417
    Unused2 = 418
    MisdirectedRequest = 421
    UnprocessableContent = 422
    UpgradeRequired = 426
    InternalServerError = 500
    NotImplemented = 501
    BadGateway = 502
    ServiceUnavailable = 503
    GatewayTimeout = 504
    HTTPVersionNotSupported = 505
    AlreadyInitialized = 506
    NotInitialized = 507
    ThirdPartyQueryFailed = 508
    MemoryAllocationError = 509
    UnstableConnection = 510
    PoweredOn = 600
    PoweredOff = 601
    Idle = 602
    Disconnected = 603
    EmergencyStop = 604
    FaultState = 605
    RequestToDeviceFailed = 606
    ConnectionWatchdog = 606  # the protocol gives this number two names
    TemperatureError = 607
    HardwareLimit = 608
    DeadmanSwitchReleased = 609
    Calibrated = 610
    NotCalibrated = 611
    RealTimeViolation = 800
    LowManipulability = 801
    EndEffectorToleranceViolation = 802
    WorkspaceViolation = 804
    CiA301EMCY = 1000
    CiA402MotorInFault = 1001
    CiA402MotorInQuickStop = 1002
    CiA402NoModesOfOperationPossible = 1003
    CiA402ModeOfOperationTimeout = 1004
    CiA402TransitionTimeout = 1005
    SDOWriteAbort = 1006
    SDOReadAbort = 1007
    PPM_FollowingError = 1008
    PPM_TargetReached = 1009
    PPM_SetPointAck = 1010
    VOM_SpeedLimited = 1011
    PVM_TargetReached = 1012
    PVM_SpeedZero = 1013
    PVM_SpeedLimited = 1014
    PVM_MaxSlippage = 1015
    PTM_TargetReached = 1016
    PTM_TorqueLimited = 1017
    IPM_TargetReached = 1018
    IPM_ModeSet = 1019
    IPM_FollowingError = 1020
    CSP_FollowingCommand = 1021
    CSP_FollowingError = 1022
    CSV_FollowingCommand = 1023
    CST_FollowingCommand = 1024
    ECMotorNotEnabled = 1100
    UR_UpdatingFirmware = 2100
    UR_TeachButtonPressed = 2101
    UR_PowerButtonPressed = 2102
    UR_NoController = 2103
    UR_BackDrive = 2104
    UR_Booting = 2105
    UR_Running = 2106
    UR_ProgramRunning = 2107
    UR_NormalMode = 2108
    UR_ReducedMode = 2109
    UR_RecoveryMode = 2110
    UR_ProtectiveStop = 2111
    UR_SafeguardStop = 2112
    UR_SystemEmergencyStop = 2113
    UR_RobotEmergencyStop = 2114
    UR_StoppedDueToSafety = 2115
    UR_ConfirmSafety = 2116
    UR_Violation = 2117

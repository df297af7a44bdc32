/* Declarations of the firmware's interface that out-of-tree controllers and estimators use, written from its documentation for
 * tests on the host. This is not the firmware. */
#ifndef FIRMWARE_STUB_H
#define FIRMWARE_STUB_H
#include <stdbool.h>
#include <stdint.h>

typedef struct { float x, y, z; } Axis3f;
typedef struct { uint32_t timestamp; float roll, pitch, yaw; } attitude_t;
typedef struct { uint32_t timestamp; float x, y, z; } point_t;
typedef point_t velocity_t;
typedef point_t acc_t;
typedef struct { uint32_t timestamp; float x, y, z, w; } quaternion_t;
typedef struct { Axis3f acc, gyro, mag; } sensorData_t;
typedef struct {
    attitude_t attitude;
    quaternion_t attitudeQuaternion;
    point_t position;
    velocity_t velocity;
    acc_t acc;
} state_t;
typedef enum { modeDisable = 0, modeAbs, modeVelocity } stab_mode_t;
typedef struct {
    uint32_t timestamp;
    attitude_t attitude, attitudeRate;
    quaternion_t attitudeQuaternion;
    float thrust;
    point_t position;
    velocity_t velocity;
    acc_t acceleration;
    bool velocity_body;
    struct { stab_mode_t x, y, z, roll, pitch, yaw, quat; } mode;
} setpoint_t;
typedef enum { controlModeLegacy = 0, controlModeForceTorque = 1 } control_mode_t;
typedef struct {
    union {
        struct { int16_t roll, pitch, yaw; float thrust; };
        struct { float thrustSi; float torque[3]; };
    };
    control_mode_t controlMode;
} control_t;
typedef uint32_t stabilizerStep_t;

#define RATE_DO_EXECUTE(RATE_HZ, STEP) (((STEP) % (1000 / (RATE_HZ))) == 0)
#define M2T(ms) (ms)
#define LOG_UINT8 1
#define LOG_FLOAT 7
#define LOG_GROUP_START(name)
#define LOG_ADD(kind, name, address) _Static_assert(sizeof(address) == sizeof(void *), #name);
#define LOG_GROUP_STOP(name)

typedef struct { Axis3f gyro; } gyroscopeMeasurement_t;
typedef struct { Axis3f acc; } accelerationMeasurement_t;
typedef struct {
    union { struct { float x, y, z; }; float pos[3]; };
    quaternion_t quat;
    float stdDevPos, stdDevQuat;
} poseMeasurement_t;
typedef enum {
    MeasurementTypeTDOA, MeasurementTypePosition, MeasurementTypePose, MeasurementTypeGyroscope = 9,
    MeasurementTypeAcceleration
} MeasurementType;
typedef struct {
    MeasurementType type;
    union {
        poseMeasurement_t pose;
        gyroscopeMeasurement_t gyroscope;
        accelerationMeasurement_t acceleration;
    } data;
} measurement_t;
typedef void *TaskHandle_t;
#define pdTRUE 1
#define portMAX_DELAY 0xffffffffu
#define taskENTER_CRITICAL()
#define taskEXIT_CRITICAL()
#define LOG_UINT16 2
TaskHandle_t xTaskGetCurrentTaskHandle(void);
void xTaskNotifyGive(TaskHandle_t task);
uint32_t ulTaskNotifyTake(int clears, uint32_t ticks);
bool supervisorIsFlying(void);
bool estimatorDequeue(measurement_t *measurement);
void estimatorOutOfTreeInit(void);
bool estimatorOutOfTreeTest(void);
void estimatorOutOfTree(state_t *state, const stabilizerStep_t step);
void vTaskDelay(uint32_t ticks);
float pmGetBatteryVoltage(void);
void controllerPidInit(void);
bool controllerPidTest(void);
void controllerPid(control_t *control, const setpoint_t *setpoint, const sensorData_t *sensors, const state_t *state,
                   const stabilizerStep_t step);
void appMain(void);
void controllerOutOfTreeInit(void);
bool controllerOutOfTreeTest(void);
void controllerOutOfTree(control_t *control, const setpoint_t *setpoint, const sensorData_t *sensors,
                         const state_t *state, const stabilizerStep_t step);
#endif

/* What surrounds the estimator in a vehicle, for tests: called from Python with plain arrays. */
#include <setjmp.h>

#include "firmware_stub.h"

void estimator_work(void);

static measurement_t queue[20];
static int waiting, taken, noticed;
static bool flies;
static jmp_buf out_of_app;

TaskHandle_t xTaskGetCurrentTaskHandle(void) { return &noticed; }
void xTaskNotifyGive(TaskHandle_t task) { (void)task, noticed++; }
uint32_t ulTaskNotifyTake(int clears, uint32_t ticks) {
    (void)clears, (void)ticks;
    longjmp(out_of_app, 1);
}
void stub_begin_app(void) {
    if (!setjmp(out_of_app)) appMain();
}
bool supervisorIsFlying(void) { return flies; }
bool estimatorDequeue(measurement_t *measurement) {
    if (taken >= waiting) return false;
    *measurement = queue[taken++];
    return true;
}

/* One loop: acc g, gyro deg/s (6), and a pose (7) or NULL. The task runs after it where works is not 0. out: position,
 * velocity, quaternion x y z w, roll, pitch, yaw deg, acc g (16). Counts notices to the task. */
int stub_loop(uint32_t step, const float *imu, const float *pose, int flying, int works, float *out) {
    static state_t state;
    waiting = taken = noticed = 0;
    flies = flying;
    measurement_t m = {.type = MeasurementTypeGyroscope};
    m.data.gyroscope.gyro = (Axis3f){imu[3], imu[4], imu[5]};
    queue[waiting++] = m;
    m.type = MeasurementTypeAcceleration;
    m.data.acceleration.acc = (Axis3f){imu[0], imu[1], imu[2]};
    queue[waiting++] = m;
    if (pose) {
        m.type = MeasurementTypePose;
        m.data.pose = (poseMeasurement_t){.x = pose[0], .y = pose[1], .z = pose[2]};
        m.data.pose.quat = (quaternion_t){0, pose[3], pose[4], pose[5], pose[6]};
        queue[waiting++] = m;
    }
    estimatorOutOfTree(&state, step);
    if (noticed && works) estimator_work();
    const float found[16] = {state.position.x, state.position.y, state.position.z, state.velocity.x, state.velocity.y,
                             state.velocity.z, state.attitudeQuaternion.x, state.attitudeQuaternion.y,
                             state.attitudeQuaternion.z, state.attitudeQuaternion.w, state.attitude.roll,
                             state.attitude.pitch, state.attitude.yaw, state.acc.x, state.acc.y, state.acc.z};
    for (int i = 0; i < 16; i++) out[i] = found[i];
    return noticed;
}

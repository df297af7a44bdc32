/* Out-of-tree estimator of the Crazyflie firmware around drag_filter.c. The stabilizer's loop collects measurements and
 * reads the state; the task of the app computes a row of the filter every 10 ms. */
#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <string.h>

#include "FreeRTOS.h"
#include "app.h"
#include "estimator.h"
#include "log.h"
#include "stabilizer_types.h"
#include "supervisor.h"
#include "task.h"

#include "drag_filter.h"

#define POSE_AGE_S 0.0f /* s, how old a pose is when it arrives */
#define RAD 0.01745329252f
#define DEG 57.29577951f
#define G_M_S2 9.81f
#define RATE_HZ 100
enum { MOST = 4 };

typedef struct {
    float dt_s, acc[3], gyro[3];
    bool flying;
    int count;
    DragFilterPose poses[MOST];
} FilterRow;

static FilterRow next, work;
static uint32_t arrived[MOST], last_step;
static DragFilterState result;
static TaskHandle_t task;
static volatile bool busy;
static uint8_t running;
static uint16_t overruns;

/* One row of the filter, in the task of the app. */
void estimator_work(void);

void estimator_work(void) {
    DragFilterState found;
    for (int i = 0; i < work.count && !drag_filter_running(); i++) drag_filter_start(&work.poses[i]);
    drag_filter_step(work.dt_s, work.acc, work.gyro, work.flying, work.poses, work.count, &found);
    const bool runs = drag_filter_running();
    taskENTER_CRITICAL();
    result = found;
    running = runs;
    busy = false;
    taskEXIT_CRITICAL();
}

void appMain(void) {
    task = xTaskGetCurrentTaskHandle();
    while (1) {
        ulTaskNotifyTake(pdTRUE, portMAX_DELAY);
        estimator_work();
    }
}

void estimatorOutOfTreeInit(void) {
    memset(&next, 0, sizeof next);
    result = (DragFilterState){.quaternion = {0.0f, 0.0f, 0.0f, 1.0f}};
    last_step = 0;
}

bool estimatorOutOfTreeTest(void) { return true; }

static void collect(uint32_t step) {
    measurement_t m;
    while (estimatorDequeue(&m)) {
        switch (m.type) {
        case MeasurementTypeGyroscope:
            next.gyro[0] = m.data.gyroscope.gyro.x * RAD;
            next.gyro[1] = m.data.gyroscope.gyro.y * RAD;
            next.gyro[2] = m.data.gyroscope.gyro.z * RAD;
            break;
        case MeasurementTypeAcceleration:
            next.acc[0] = m.data.acceleration.acc.x * G_M_S2;
            next.acc[1] = m.data.acceleration.acc.y * G_M_S2;
            next.acc[2] = m.data.acceleration.acc.z * G_M_S2;
            break;
        case MeasurementTypePose:
            if (next.count < MOST) { /* more than these within a row are left out */
                arrived[next.count] = step;
                next.poses[next.count++] = (DragFilterPose){
                    {m.data.pose.x, m.data.pose.y, m.data.pose.z},
                    {m.data.pose.quat.x, m.data.pose.quat.y, m.data.pose.quat.z, m.data.pose.quat.w}, 0.0f};
            }
            break;
        default:
            break;
        }
    }
}

static void hand_over(uint32_t step) {
    if (busy) {
        overruns++; /* its time is added to the next row */
        return;
    }
    next.dt_s = 0.001f * (float)(step - last_step);
    next.flying = supervisorIsFlying();
    for (int i = 0; i < next.count; i++) next.poses[i].age_s = POSE_AGE_S + 0.001f * (float)(step - arrived[i]);
    work = next;
    next.count = 0;
    last_step = step;
    busy = true;
    if (task) xTaskNotifyGive(task);
    else busy = false; /* the app has not begun yet */
}

void estimatorOutOfTree(state_t *state, const stabilizerStep_t stabilizerStep) {
    collect(stabilizerStep);
    if (RATE_DO_EXECUTE(RATE_HZ, stabilizerStep)) hand_over(stabilizerStep);
    const float *p = result.position_m, *v = result.velocity_m_s, *a = next.acc;
    const float x = result.quaternion[0], y = result.quaternion[1], z = result.quaternion[2], w = result.quaternion[3];
    state->position.x = p[0], state->position.y = p[1], state->position.z = p[2];
    state->velocity.x = v[0], state->velocity.y = v[1], state->velocity.z = v[2];
    state->attitudeQuaternion.x = x, state->attitudeQuaternion.y = y;
    state->attitudeQuaternion.z = z, state->attitudeQuaternion.w = w;
    state->attitude.roll = DEG * atan2f(2.0f * (w * x + y * z), w * w - x * x - y * y + z * z);
    state->attitude.pitch = -DEG * asinf(fminf(fmaxf(2.0f * (w * y - x * z), -1.0f), 1.0f)); /* legacy: nose up */
    state->attitude.yaw = DEG * atan2f(2.0f * (w * z + x * y), w * w + x * x - y * y - z * z);
    state->acc.x = ((1.0f - 2.0f * (y * y + z * z)) * a[0] + 2.0f * (x * y - z * w) * a[1] + 2.0f * (x * z + y * w) * a[2]) / G_M_S2;
    state->acc.y = (2.0f * (x * y + z * w) * a[0] + (1.0f - 2.0f * (x * x + z * z)) * a[1] + 2.0f * (y * z - x * w) * a[2]) / G_M_S2;
    state->acc.z = (2.0f * (x * z - y * w) * a[0] + 2.0f * (y * z + x * w) * a[1] + (1.0f - 2.0f * (x * x + y * y)) * a[2]) / G_M_S2 - 1.0f;
}

LOG_GROUP_START(dragFilter)
LOG_ADD(LOG_UINT8, running, &running)
LOG_ADD(LOG_UINT16, overruns, &overruns)
LOG_GROUP_STOP(dragFilter)

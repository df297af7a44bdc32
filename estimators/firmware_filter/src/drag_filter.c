/* The filter of drag_filter.h; estimators/inertial_core.py is the same in Python. */
#include "drag_filter.h"

#include <math.h>
#include <string.h>

#include "filter_settings.h"

/* Error state: position, velocity, attitude, biases of accelerometer and gyro, rotation of the tracked frame, drift of
 * the vertical accelerometer, air flow x and y, delay of the rows' time and its wander. */
enum { P = 0, V = 3, T = 6, BA = 9, BG = 12, M = 15, S = 18, A = 19, L = 21, W = 22, N = 23 };
enum { ROWS = 32 }; /* rows that are kept for late poses and slopes */

static const float GRAVITY_M_S2 = 9.81f, NOMINAL_S = 0.01f, LARGEST = 1e3f, LONGEST_S = 0.5f;

typedef struct {
    float ago_s; /* before the newest row */
    float dt_s, acc[3], gyro[3], push[3], turn[4]; /* of the step to this row: world acceleration, rotation */
} Row;

static struct {
    bool running, flying;
    float position[3], velocity[3], q[4], acc_bias[3], gyro_bias[3], mount[3], slope, air[2], late, wander;
    float missing_s, pose_ago_s, gap_s;
    bool posed;
    int rows; /* of the ring, the newest first */
    Row ring[ROWS];
    DragFilterState last;
} me = {.last = {.quaternion = {0.0f, 0.0f, 0.0f, 1.0f}}};

static float cov[N][N], moved[N][N], x[N], h[N], ph[N], gain[N];

static float square(float a) { return a * a; }

static void rotation(const float q[4], float r[3][3]) {
    const float a = q[0], b = q[1], c = q[2], w = q[3];
    r[0][0] = 1.0f - 2.0f * (b * b + c * c), r[0][1] = 2.0f * (a * b - c * w), r[0][2] = 2.0f * (a * c + b * w);
    r[1][0] = 2.0f * (a * b + c * w), r[1][1] = 1.0f - 2.0f * (a * a + c * c), r[1][2] = 2.0f * (b * c - a * w);
    r[2][0] = 2.0f * (a * c - b * w), r[2][1] = 2.0f * (b * c + a * w), r[2][2] = 1.0f - 2.0f * (a * a + b * b);
}

static void product(const float p[4], const float d[4], float out[4]) {
    const float a = p[0], b = p[1], c = p[2], w = p[3];
    const float r[4] = {w * d[0] + a * d[3] + b * d[2] - c * d[1], w * d[1] - a * d[2] + b * d[3] + c * d[0],
                        w * d[2] + a * d[1] - b * d[0] + c * d[3], w * d[3] - a * d[0] - b * d[1] - c * d[2]};
    const float length = sqrtf(r[0] * r[0] + r[1] * r[1] + r[2] * r[2] + r[3] * r[3]);
    for (int i = 0; i < 4; i++) out[i] = r[i] / length;
}

static void quaternion_of(const float angle[3], float out[4]) {
    const float half = 0.5f * sqrtf(square(angle[0]) + square(angle[1]) + square(angle[2]));
    const float s = half < 1e-4f ? 0.5f : 0.5f * sinf(half) / half;
    for (int i = 0; i < 3; i++) out[i] = s * angle[i];
    out[3] = cosf(half);
}

static void turned(const float q[4], const float angle[3], float out[4]) {
    float d[4];
    quaternion_of(angle, d);
    product(q, d, out);
}

/* Twice the vector part of conj(q) w: the rotation from q to w, in the body. */
static void small_angle(const float q[4], const float w[4], float out[3]) {
    const float sign = w[0] * q[0] + w[1] * q[1] + w[2] * q[2] + w[3] * q[3] >= 0.0f ? 2.0f : -2.0f;
    out[0] = sign * (q[3] * w[0] - q[0] * w[3] - q[1] * w[2] + q[2] * w[1]);
    out[1] = sign * (q[3] * w[1] + q[0] * w[2] - q[1] * w[3] - q[2] * w[0]);
    out[2] = sign * (q[3] * w[2] - q[0] * w[1] + q[1] * w[0] - q[2] * w[3]);
}

static bool within(const float *values, int n, float most) {
    bool good = true;
    for (int i = 0; i < n; i++) good = good && fabsf(values[i]) <= most; /* false for what is no number */
    return good;
}

static bool valid(const DragFilterPose *pose) {
    const float *q = pose->quaternion;
    const float squares = square(q[0]) + square(q[1]) + square(q[2]) + square(q[3]);
    return within(pose->position_m, 3, LARGEST) && squares > 0.25f && squares < 4.0f && within(&pose->age_s, 1, LONGEST_S);
}

/* to = (F from)^T for the transition F of one step. */
static void transition(float from[N][N], float to[N][N], float dt, float rot[3][3], const float f[3], const float w[3],
                       float air, float wander) {
    for (int j = 0; j < N; j++) {
        const float tx = from[T][j], ty = from[T + 1][j], tz = from[T + 2][j];
        const float bx = from[BA][j], by = from[BA + 1][j], bz = from[BA + 2][j];
        const float g[3] = {f[1] * tz - f[2] * ty + bx, f[2] * tx - f[0] * tz + by, f[0] * ty - f[1] * tx + bz};
        for (int k = 0; k < 3; k++) {
            to[j][P + k] = from[P + k][j] + dt * from[V + k][j];
            to[j][V + k] = from[V + k][j] - dt * (rot[k][0] * g[0] + rot[k][1] * g[1] + rot[k][2] * g[2]);
            to[j][BG + k] = from[BG + k][j];
            to[j][M + k] = from[M + k][j];
        }
        to[j][T] = tx - dt * (w[1] * tz - w[2] * ty + from[BG][j]);
        to[j][T + 1] = ty - dt * (w[2] * tx - w[0] * tz + from[BG + 1][j]);
        to[j][T + 2] = tz - dt * (w[0] * ty - w[1] * tx + from[BG + 2][j]);
        to[j][BA] = bx, to[j][BA + 1] = by;
        to[j][BA + 2] = bz + dt * from[S][j];
        to[j][S] = from[S][j];
        to[j][A] = air * from[A][j], to[j][A + 1] = air * from[A + 1][j];
        to[j][L] = from[L][j], to[j][W] = wander * from[W][j];
    }
}

/* One scalar measurement of h on cov and x. */
static void scalar(float innovation, float variance) {
    float s = variance;
    memset(ph, 0, sizeof ph);
    for (int k = 0; k < N; k++) {
        if (h[k] == 0.0f) continue;
        for (int i = 0; i < N; i++) ph[i] += h[k] * cov[k][i];
        innovation -= h[k] * x[k];
    }
    for (int k = 0; k < N; k++) s += h[k] * ph[k];
    for (int i = 0; i < N; i++) {
        gain[i] = ph[i] / s;
        x[i] += gain[i] * innovation;
    }
    for (int i = 0; i < N; i++) /* Joseph's form */
        for (int j = 0; j <= i; j++)
            cov[i][j] = cov[j][i] = cov[i][j] - gain[i] * ph[j] - ph[i] * gain[j] + s * gain[i] * gain[j];
}

static void give(DragFilterState *out) {
    if (me.running) {
        const float on = LATE_MOVES * (me.late + me.wander);
        for (int k = 0; k < 3; k++) {
            me.last.position_m[k] = me.position[k] + on * me.velocity[k];
            me.last.velocity_m_s[k] = me.velocity[k];
        }
        memcpy(me.last.quaternion, me.q, sizeof me.q);
    }
    *out = me.last;
}

bool drag_filter_running(void) { return me.running; }

bool drag_filter_start(const DragFilterPose *pose) {
    static const float none[3] = {0.0f, 0.0f, 0.0f};
    const DragFilterState last = me.last;
    if (!valid(pose)) return false;
    memset(&me, 0, sizeof me);
    memset(cov, 0, sizeof cov);
    me.last = last;
    me.running = true;
    memcpy(me.position, pose->position_m, sizeof me.position);
    turned(pose->quaternion, none, me.q); /* of length one */
    me.slope = SLOPE_MEAN;
    for (int k = 0; k < 3; k++) {
        cov[P + k][P + k] = square(START_POSITION_SD), cov[V + k][V + k] = square(START_VELOCITY_SD);
        cov[T + k][T + k] = square(START_TILT_SD), cov[M + k][M + k] = square(MOUNT_SD);
        cov[BA + k][BA + k] = square(k == 2 ? ACC_BIAS_Z_SD : ACC_BIAS_SD);
        cov[BG + k][BG + k] = square(GYRO_BIAS_SD);
    }
    cov[S][S] = square(SLOPE_SD), cov[A][A] = cov[A + 1][A + 1] = square(AIR_SD);
    cov[L][L] = square(LATE_SD), cov[W][W] = square(WANDER_SD);
    for (int k = 0; k < N; k++) cov[k][k] += 1e-14f;
    return true;
}

/* The state and its covariance to the newest row of the ring. */
static void predict(bool lifts) {
    Row *now = &me.ring[0];
    const Row *before = &me.ring[1];
    const float dt = now->dt_s;
    float f[3], w[3], angle[3], q[4], half[3][3];
    for (int k = 0; k < 3; k++) {
        f[k] = 0.5f * (now->acc[k] + before->acc[k]) - me.acc_bias[k];
        w[k] = 0.5f * (now->gyro[k] + before->gyro[k]) - me.gyro_bias[k];
        angle[k] = 0.5f * dt * w[k];
    }
    turned(me.q, angle, q);
    rotation(q, half);
    for (int k = 0; k < 3; k++) {
        now->push[k] = half[k][0] * f[0] + half[k][1] * f[1] + half[k][2] * f[2] - (k == 2 ? GRAVITY_M_S2 : 0.0f);
        me.position[k] += dt * me.velocity[k] + 0.5f * dt * dt * now->push[k];
        me.velocity[k] += dt * now->push[k];
        angle[k] = dt * w[k];
    }
    quaternion_of(angle, now->turn);
    product(me.q, now->turn, q);
    memcpy(me.q, q, sizeof q);
    me.acc_bias[2] += dt * me.slope;
    const float air = expf(-dt / AIR_S), wander = expf(-dt / WANDER_S);
    me.air[0] *= air, me.air[1] *= air, me.wander *= wander;
    transition(cov, moved, dt, half, f, w, air, wander);
    transition(moved, cov, dt, half, f, w, air, wander);

    int back = 1; /* the first row that is long enough ago for a slope */
    while (back + 1 < me.rows && me.ring[back].ago_s < CHANGE_S) back++;
    const Row *old = &me.ring[back];
    const float share = square(STAMP / fmaxf(old->ago_s, 1e-3f));
    const float level = 0.5f * (square(now->acc[0] - old->acc[0]) + square(now->acc[1] - old->acc[1])) * share;
    const float upright = square(now->acc[2] - old->acc[2]) * share;
    const float turn = (square(now->gyro[0] - old->gyro[0]) + square(now->gyro[1] - old->gyro[1]) +
                        square(now->gyro[2] - old->gyro[2])) / 3.0f * share;
    for (int k = 0; k < 3; k++) {
        cov[V + k][V + k] += (square(k == 2 ? VERTICAL_NOISE : ACC_NOISE) + (k == 2 ? upright : level)) * dt;
        cov[T + k][T + k] += (square(GYRO_NOISE) + turn) * dt;
        cov[M + k][M + k] += square(MOUNT_WALK) * dt;
        cov[BA + k][BA + k] += square(ACC_WALK) * dt + (lifts ? square(LIFT_BIAS_SD) : 0.0f);
        cov[BG + k][BG + k] += square(GYRO_WALK) * dt;
    }
    for (int k = 0; k < 2; k++) cov[A + k][A + k] += square(AIR_SD) * (1.0f - air * air);
    cov[W][W] += square(WANDER_SD) * (1.0f - wander * wander);
}

static void take_pose(const DragFilterPose *pose) {
    const float back = pose->age_s - (me.late + me.wander);
    int m = 0; /* the oldest row that is not before the pose */
    while (m + 1 < me.rows && me.ring[m + 1].ago_s <= back) m++;
    const int lo = m + 1 < me.rows ? m + 1 : m;
    float part = 0.0f;
    if (lo > m)
        part = fminf(fmaxf((me.ring[lo].ago_s - back) / fmaxf(me.ring[lo].ago_s - me.ring[m].ago_s, 1e-9f), 0.0f), 1.0f);
    /* what the IMU alone would have integrated to since row lo: at the pose, and now */
    float place[3] = {0}, speed[3] = {0}, sum_p[3] = {0}, sum_v[3] = {0}, past[3], then[4];
    for (int r = lo - 1; r >= 0; r--) {
        const float dt = me.ring[r].dt_s;
        for (int k = 0; k < 3; k++) {
            sum_p[k] += dt * sum_v[k] + 0.5f * dt * dt * me.ring[r].push[k];
            sum_v[k] += dt * me.ring[r].push[k];
            if (r == m) place[k] = part * sum_p[k], speed[k] = part * sum_v[k];
        }
    }
    for (int k = 0; k < 3; k++) {
        past[k] = me.position[k] - me.velocity[k] * back + (back < 0.0f ? 0.0f : sum_v[k] * back - (sum_p[k] - place[k]));
        speed[k] = me.velocity[k] - (back < 0.0f ? 0.0f : sum_v[k] - speed[k]);
    }
    memcpy(then, me.q, sizeof then);
    if (back >= 0.0f) {
        float since[4] = {0.0f, 0.0f, 0.0f, 1.0f}, step[4], angle[3];
        static const float still[4] = {0.0f, 0.0f, 0.0f, 1.0f};
        for (int r = (part > 0.5f ? m : lo) - 1; r >= 0; r--) {
            product(since, me.ring[r].turn, step);
            memcpy(since, step, sizeof step);
        }
        small_angle(since, still, angle);
        turned(me.q, angle, then);
    }
    const float length = sqrtf(square(pose->quaternion[0]) + square(pose->quaternion[1]) + square(pose->quaternion[2]) +
                               square(pose->quaternion[3]));
    float seen[4], off[3];
    for (int k = 0; k < 4; k++) seen[k] = pose->quaternion[k] / length;
    small_angle(then, seen, off);
    const float apart = me.posed ? fmaxf(me.pose_ago_s - pose->age_s, 1e-3f) : 1.0f;
    const float fewer = (1.0f + TILT_S / apart) / (1.0f + TILT_S / NOMINAL_S);
    me.posed = true;
    me.pose_ago_s = pose->age_s;
    for (int k = 0; k < 3; k++) {
        memset(h, 0, sizeof h);
        h[P + k] = 1.0f, h[V + k] = -back;
        h[L] = LATE_SD > 0.0f ? speed[k] : 0.0f;
        h[W] = WANDER_SD > 0.0f ? speed[k] : 0.0f;
        scalar(pose->position_m[k] - past[k], square(POSITION_SD));
    }
    static const float sd[3] = {ROLL_PITCH_SD, PITCH_SD, YAW_SD};
    for (int k = 0; k < 3; k++) {
        const float rate = me.ring[0].gyro[k] - me.gyro_bias[k];
        memset(h, 0, sizeof h);
        h[T + k] = h[M + k] = 1.0f;
        h[L] = LATE_SD > 0.0f ? rate : 0.0f;
        h[W] = WANDER_SD > 0.0f ? rate : 0.0f;
        scalar(off[k] - me.mount[k], square(sd[k]) * (k == 2 ? 1.0f : fewer));
    }
}

static void take_drag(float rot[3][3]) {
    float bv[3];
    for (int k = 0; k < 3; k++) bv[k] = rot[0][k] * me.velocity[0] + rot[1][k] * me.velocity[1] + rot[2][k] * me.velocity[2];
    for (int k = 0; k < 2; k++) {
        float d[3] = {0.0f, 0.0f, 0.0f};
        d[k] = DRAG + 2.0f * DRAG_QUADRATIC * fabsf(bv[k]);
        d[1 - k] = DRAG_CROSS;
        const float force = DRAG * bv[k] + DRAG_QUADRATIC * fabsf(bv[k]) * bv[k] + DRAG_CROSS * bv[1 - k];
        memset(h, 0, sizeof h);
        for (int m = 0; m < 3; m++) h[V + m] = -(rot[m][0] * d[0] + rot[m][1] * d[1] + rot[m][2] * d[2]);
        h[T] = -(d[1] * bv[2] - d[2] * bv[1]);
        h[T + 1] = -(d[2] * bv[0] - d[0] * bv[2]);
        h[T + 2] = -(d[0] * bv[1] - d[1] * bv[0]);
        h[BA + k] = 1.0f;
        h[A + k] = AIR_SD > 0.0f ? 1.0f : 0.0f;
        scalar(me.ring[0].acc[k] - me.acc_bias[k] - me.air[k] + force, square(DRAG_SD));
    }
}

static void correct(void) {
    float q[4];
    for (int k = 0; k < 3; k++) {
        me.position[k] += x[P + k];
        me.velocity[k] += x[V + k];
        me.acc_bias[k] += x[BA + k];
        me.gyro_bias[k] += x[BG + k];
        me.mount[k] += x[M + k];
    }
    turned(me.q, x + T, q);
    memcpy(me.q, q, sizeof q);
    me.slope += x[S];
    me.air[0] += x[A], me.air[1] += x[A + 1];
    me.late += x[L], me.wander += x[W];
}

void drag_filter_step(float dt_s, const float acc[3], const float gyro[3], bool flying, const DragFilterPose *poses,
                      int count, DragFilterState *out) {
    me.gap_s += dt_s;
    if (!(me.gap_s >= 0.0f && me.gap_s <= LONGEST_S)) me.running = false, me.gap_s = 0.0f; /* no number is neither */
    if (me.running && within(acc, 3, LARGEST) && within(gyro, 3, LARGEST) && (me.rows == 0 || me.gap_s > 0.0f)) {
        memmove(me.ring + 1, me.ring, sizeof(Row) * (ROWS - 1));
        if (me.rows < ROWS) me.rows++;
        for (int r = 1; r < me.rows; r++) me.ring[r].ago_s += me.gap_s;
        me.ring[0] = (Row){.dt_s = me.rows > 1 ? me.gap_s : 0.0f, .turn = {0.0f, 0.0f, 0.0f, 1.0f}};
        memcpy(me.ring[0].acc, acc, sizeof me.ring[0].acc);
        memcpy(me.ring[0].gyro, gyro, sizeof me.ring[0].gyro);
        me.pose_ago_s += me.gap_s;
        me.gap_s = 0.0f;
        if (me.rows > 1) predict(flying && !me.flying);
        me.flying = flying;
        memset(x, 0, sizeof x);
        float rot[3][3];
        rotation(me.q, rot);
        for (int i = 0; i < count; i++)
            if (valid(&poses[i])) take_pose(&poses[i]);
        if (DRAG > 0.0f && flying) take_drag(rot);
        correct();
        me.running = within(me.position, 3, LARGEST) && within(me.velocity, 3, LARGEST) && within(me.q, 4, 2.0f) &&
                     within(&cov[0][0], N * N, 1e6f);
    }
    give(out);
}

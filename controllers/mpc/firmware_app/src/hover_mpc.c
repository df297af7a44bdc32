/* The controller of hover_mpc.h; controllers/mpc/hover_mpc.py is the same in Python. */
#include "hover_mpc.h"

#include <math.h>
#include <stdbool.h>
#include <string.h>

#include "daqp/daqp.h"
#include "hover_program.h"
#include "vehicle_parameters.h"

#define N HOVER_MPC_UNKNOWNS
#define S HOVER_MPC_ERRORS

static const float LARGEST = 1e3f;        /* m, m/s, m/s^2, rad, rad/s: beyond this nothing was measured */
static const float HOLD_S = 0.1f;         /* the last valid state is used for so long */
static const float SINK = 0.9f;           /* share of hover thrust without a valid state */
static const float LEAST_LIFT = 0.2f;     /* of gravity: no target is upside down */
static const float VOLTAGE_SHARE = 0.01f; /* of a new voltage in the filtered one, every millisecond */
static const float LEAST_V = 2.0f, MOST_V = 6.0f, REST_V = 3.7f, START_V = 4.2f;

static struct {
    HoverMpcState state;
    HoverMpcReference reference;
    bool flown, asked;
    float missing_s, battery_V, filtered_V;
    float integral[4], rotor_N[4];
    int iterations;
} me;

/* Memory of the solver; its working set is never larger than its iterations. */
static float upper[N], lower[N], lam[N + 1], lam_star[N + 1], step_u[N], l_factor[(N + 1) * (N + 2) / 2], d_factor[N + 1],
    x_factor[N + 1], z_factor[N + 1], scaled[N];
static int sense[N], working[N + 1];

void hover_mpc_reset(void) {
    memset(&me, 0, sizeof me);
    me.battery_V = REST_V;
    me.filtered_V = START_V;
    for (int i = 0; i < 4; i++) me.rotor_N[i] = 0.25f * VEHICLE_MASS_KG * VEHICLE_GRAVITY_M_S2;
}

int hover_mpc_iterations(void) { return me.iterations; }

static float clamped(float x, float most) { return fminf(fmaxf(x, -most), most); }

static bool within(const float *x, int n, float most) {
    bool good = true;
    for (int i = 0; i < n; i++) good = good && fabsf(x[i]) <= most; /* false for what is no number */
    return good;
}

/* Takes in a state; false once there has been no valid one for HOLD_S. */
static bool admit_state(const HoverMpcState *s) {
    float squares = 0.0f;
    for (int i = 0; i < 4; i++) squares += s->quaternion[i] * s->quaternion[i];
    if (within(s->position_m, 3, LARGEST) && within(s->velocity_m_s, 3, LARGEST) && within(s->rate_rad_s, 3, LARGEST) &&
        squares >= 0.01f && squares <= 100.0f) {
        me.state = *s;
        for (int i = 0; i < 4; i++) me.state.quaternion[i] = s->quaternion[i] / sqrtf(squares);
        me.flown = true;
        me.missing_s = 0.0f;
        return true;
    }
    me.missing_s = fminf(me.missing_s + HOVER_MPC_PERIOD_S, 2.0f * HOLD_S);
    return me.flown && me.missing_s <= HOLD_S;
}

/* Takes in a reference; a bad one rests at the last good place, or where the vehicle is. */
static void admit_reference(const HoverMpcReference *r) {
    if (within(r->position_m, 3, LARGEST) && within(r->velocity_m_s, 3, LARGEST) &&
        within(r->acceleration_m_s2, 3, LARGEST) && within(&r->yaw_rad, 1, LARGEST) && within(r->rate_rad_s, 3, LARGEST)) {
        me.reference = *r;
        me.asked = true;
        return;
    }
    for (int i = 0; i < 3; i++) {
        if (!me.asked) me.reference.position_m[i] = me.state.position_m[i];
        me.reference.velocity_m_s[i] = me.reference.acceleration_m_s2[i] = me.reference.rate_rad_s[i] = 0.0f;
    }
    me.asked = true;
}

/* World to the frame of the heading. */
static void level(const float world[3], float c, float s, float out[3]) {
    const float x = world[0], y = world[1];
    out[0] = c * x + s * y;
    out[1] = c * y - s * x;
    out[2] = world[2];
}

/* Thrusts [N] and attitude that fly the reference against the air. */
static void wanted(float c, float s, float forward_N[4], float q[4]) {
    float speed[3], push[3];
    level(me.reference.velocity_m_s, c, s, speed);
    level(me.reference.acceleration_m_s2, c, s, push);
    for (int i = 0; i < 3; i++) push[i] += VEHICLE_DRAG_1_S[i] * speed[i];
    push[2] = fmaxf(push[2] + VEHICLE_GRAVITY_M_S2, LEAST_LIFT * VEHICLE_GRAVITY_M_S2);
    const float length = sqrtf(push[0] * push[0] + push[1] * push[1] + push[2] * push[2]);
    for (int i = 0; i < 4; i++) {
        forward_N[i] = 0.25f * VEHICLE_MASS_KG * length;
        for (int j = 0; j < 3; j++) forward_N[i] += VEHICLE_AIR_N_S_M[i][j] * speed[j];
    }
    const float roll = 0.5f * asinf(fminf(fmaxf(-push[1] / length, -1.0f), 1.0f));
    const float pitch = 0.5f * atan2f(push[0], push[2]), yaw = 0.5f * me.reference.yaw_rad;
    const float cr = cosf(roll), sr = sinf(roll), cp = cosf(pitch), sp = sinf(pitch), cy = cosf(yaw), sy = sinf(yaw);
    q[0] = sr * cp * cy - cr * sp * sy;
    q[1] = cr * sp * cy + sr * cp * sy;
    q[2] = cr * cp * sy - sr * sp * cy;
    q[3] = cr * cp * cy + sr * sp * sy;
}

/* Errors against the reference, limited, and their integrals. */
static void errors(float c, float s, const float forward_N[4], const float target[4], float e[S]) {
    const float *q = me.state.quaternion, *p = target;
    float away[3], faster[3], pull[3], turn[3];
    for (int i = 0; i < 3; i++) {
        away[i] = me.state.position_m[i] - me.reference.position_m[i];
        faster[i] = me.state.velocity_m_s[i] - me.reference.velocity_m_s[i];
        pull[i] = LIMIT_POSITION_1_S2[i] * away[i] + LIMIT_VELOCITY_1_S[i] * faster[i];
    }
    const float across = sqrtf(pull[0] * pull[0] + pull[1] * pull[1]);
    const float share = LIMIT_LEVEL_M_S2 / fmaxf(across, LIMIT_LEVEL_M_S2);
    const float up = LIMIT_UP_M_S2 / fmaxf(fabsf(pull[2]), LIMIT_UP_M_S2);
    const float part[3] = {share, share, up};
    for (int i = 0; i < 3; i++) {
        away[i] *= part[i];
        faster[i] *= part[i];
    }
    /* 2 vec(target^-1 q), the shorter way round */
    const float sign = p[3] * q[3] + p[0] * q[0] + p[1] * q[1] + p[2] * q[2] < 0.0f ? -2.0f : 2.0f;
    turn[0] = sign * (p[3] * q[0] - p[0] * q[3] - p[1] * q[2] + p[2] * q[1]);
    turn[1] = sign * (p[3] * q[1] + p[0] * q[2] - p[1] * q[3] - p[2] * q[0]);
    turn[2] = sign * (p[3] * q[2] - p[0] * q[1] + p[1] * q[0] - p[2] * q[3]);
    for (int i = 0; i < 3; i++) turn[i] = clamped(turn[i], LIMIT_TURN_RAD);
    for (int i = 0; i < 4; i++) {
        const float more = i == 3 ? turn[2] : part[i] < 1.0f ? 0.0f : away[i]; /* what is limited winds nothing up */
        me.integral[i] = clamped(me.integral[i] + HOVER_MPC_PERIOD_S * more, LIMIT_INTEGRAL[i]);
    }
    level(away, c, s, e);
    level(faster, c, s, e + 3);
    for (int i = 0; i < 3; i++) {
        e[6 + i] = turn[i];
        e[9 + i] = me.state.rate_rad_s[i] - me.reference.rate_rad_s[i];
    }
    for (int i = 0; i < 4; i++) e[12 + i] = me.rotor_N[i] - forward_N[i];
    level(me.integral, c, s, e + 16);
    e[19] = me.integral[3];
}

/* Thrusts [N] of the first stage within least and most [N]. */
static HoverMpcOutcome solve(const float e[S], const float forward_N[4], float least_N, float most_N, float thrust_N[4]) {
    bool inside = true;
    for (int i = 0; i < N; i++) {
        float sum = 0.0f;
        for (int j = 0; j < S; j++) sum += PROGRAM_FREE[i][j] * e[j];
        scaled[i] = sum;
        lower[i] = PROGRAM_SCALE[i] * (least_N - forward_N[i % 4]) - sum;
        upper[i] = PROGRAM_SCALE[i] * (most_N - forward_N[i % 4]) - sum;
        inside = inside && lower[i] <= 0.0f && upper[i] >= 0.0f;
    }
    me.iterations = 0;
    HoverMpcOutcome outcome = HOVER_MPC_FREE;
    if (!inside) {
        static DAQPSettings settings = {.primal_tol = 1e-5f, .dual_tol = 1e-7f, .zero_tol = 1e-7f, .pivot_tol = 1e-4f,
                                        .progress_tol = 1e-9f, .cycle_tol = 10, .iter_limit = HOVER_MPC_ITERATIONS,
                                        .fval_bound = 1e30f, .sing_tol = 1e-6f, .refactor_tol = 1e-5f, .rho_soft = 1e-3f};
        DAQPWorkspace work = {.n = N, .m = N, .ms = N, .dupper = upper, .dlower = lower,
                              .Rinv = (float *)PROGRAM_INVERSE, /* DAQP does not write to it */
                              .sense = sense, .lam = lam, .lam_star = lam_star, .u = step_u, .L = l_factor,
                              .D = d_factor, .xldl = x_factor, .zldl = z_factor, .WS = working,
                              .sing_ind = DAQP_EMPTY_IND, .settings = &settings};
        memset(sense, 0, sizeof sense);
        const int flag = daqp_ldp(&work);
        me.iterations = work.iterations;
        outcome = flag == DAQP_EXIT_OPTIMAL ? HOVER_MPC_BOUNDED : HOVER_MPC_CLIPPED;
    }
    for (int i = 0, row = 0; i < 4; row += N - i, i++) {
        float sum = scaled[i];
        if (outcome == HOVER_MPC_BOUNDED)
            for (int j = i; j < N; j++) sum += PROGRAM_INVERSE[row + j - i] * step_u[j];
        thrust_N[i] = fminf(fmaxf(forward_N[i] + sum / PROGRAM_SCALE[i], least_N), fmaxf(least_N, most_N));
        if (!(fabsf(thrust_N[i]) <= LARGEST)) thrust_N[i] = least_N; /* no number; cannot be while the tables are */
    }
    return outcome;
}

static float thrust_of_voltage(float v) {
    const float *c = FIRMWARE_THRUST_N;
    return fmaxf(c[0] + v * (c[1] + v * (c[2] + v * c[3])), 0.0f);
}

HoverMpcOutcome hover_mpc_step(const HoverMpcState *state, const HoverMpcReference *reference, float battery_V,
                               float wrench[4]) {
    const float hover_N = VEHICLE_MASS_KG * VEHICLE_GRAVITY_M_S2 / VEHICLE_THRUST_SCALE;
    const bool valid = admit_state(state);
    if (fabsf(battery_V) >= LEAST_V && fabsf(battery_V) <= MOST_V) me.battery_V = battery_V;
    if (!valid) {
        wrench[0] = SINK * hover_N;
        wrench[1] = wrench[2] = wrench[3] = 0.0f;
        return HOVER_MPC_SINKING;
    }
    admit_reference(reference);
    const float c = cosf(me.reference.yaw_rad), s = sinf(me.reference.yaw_rad);
    float forward_N[4], target[4], e[S], t[4];
    wanted(c, s, forward_N, target);
    errors(c, s, forward_N, target, e);
    const float least_N = VEHICLE_THRUST_SCALE * FIRMWARE_LEAST_THRUST_N;
    const float most_N = VEHICLE_THRUST_SCALE * thrust_of_voltage(me.filtered_V);
    const HoverMpcOutcome outcome = solve(e, forward_N, least_N, most_N, t);
    for (int i = 0; i < 4; i++) {
        me.rotor_N[i] += VEHICLE_MOTOR_SHARE * (t[i] - me.rotor_N[i]);
        t[i] /= VEHICLE_THRUST_SCALE;
    }
    for (int i = 0; i < HOVER_MPC_PERIOD_MS; i++) me.filtered_V += VOLTAGE_SHARE * (me.battery_V - me.filtered_V);
    wrench[0] = t[0] + t[1] + t[2] + t[3];
    wrench[1] = FIRMWARE_ARM_M * (-t[0] - t[1] + t[2] + t[3]);
    wrench[2] = FIRMWARE_ARM_M * (-t[0] + t[1] + t[2] - t[3]);
    wrench[3] = FIRMWARE_YAW_ARM_M * (-t[0] + t[1] - t[2] + t[3]);
    return outcome;
}

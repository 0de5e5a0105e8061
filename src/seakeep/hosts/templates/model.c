{% from "facts.jinja" import N, Q, s, z, past, upper, signature, follows, array with context %}
/* {{ mark }} C source; see {{ name }}.h */
#include "{{ name }}.h"

#include <float.h>
#include <math.h>
#include <string.h>

enum {
    N = {{ N }},               /* states */
    EXTENDED = {{ N * (s + 1) }},        /* states and their delays */
    Q = {{ Q }},               /* measured inputs */
    DELAYED = {{ upper }}_DELAYED,   /* regressors with input delays, each newest first */
    DELAYS = {{ z }},
    DIRECT = {{ upper }}_DIRECT,     /* regressors without */
{% if follows %}
    PLACES = {{ follows.place.count }},          /* on the grid where waves are read */
    PAST = {{ past }},            /* surges that the place of the vessel is a sum of */
    SURGE = {{ follows.column }},
    BACK = {{ follows.back }},            /* samples that carriers read, before and after */
    TAPS = {{ follows.back + follows.ahead + 1 }},
{% endif %}
    ROWS = {{ model.coefficients | length }},            /* rows of the coefficients: all, or those of the newest states */
    COLUMNS = EXTENDED + DELAYED * (DELAYS + 1) + DIRECT,
    WINDOW = {{ upper }}_WINDOW,
    NOW = {{ upper }}_NOW
};

const char *const {{ name }}_state_names[] = { {{ signature.state_labels | map(attribute="name") | map("text") | join(", ") }} };
const char *const {{ name }}_state_units[] = { {{ signature.state_labels | map(attribute="units") | map("text") | join(", ") }} };
const char *const {{ name }}_input_names[] = { {{ (signature.input_labels | map(attribute="name") | map("text") | list or ["0"]) | join(", ") }} };
const char *const {{ name }}_input_units[] = { {{ (signature.input_labels | map(attribute="units") | map("text") | list or ["0"]) | join(", ") }} };

/* Rows of [A B] on standardised deviations. */
{{ array("coefficients", model.coefficients) }}
{% for kind, scale in (("state", signature.state_scale), ("delayed", signature.input_scale), ("direct", signature.direct_scale)) %}
{{ array(kind ~ "_mean", scale.mean) -}}
{{ array(kind ~ "_std", scale.std) -}}
{{ array(kind ~ "_centre", scale.centre) -}}
{{ array(kind ~ "_reach", scale.bound) }}
{% endfor %}
{% for each in kernels %}
{{ array("kernel_%d" % loop.index0, each) }}
{% endfor %}
{% if kernels %}
/* Weighted sum of squares of a derivative of one input; u is its sample at the filter's middle. */
static double slow_square(const double *u, int order, const double *kernel, int half)
{
    double sum = 0.0;
    for (int k = -half; k <= half; k++) {
        const double *at = u + k * Q;
        double value = *at;
        if (order == 1)
            value = (at[Q] - at[-Q]) / (2.0 * {{ upper }}_STEP);
        else if (order == 2)
            value = (at[Q] - 2.0 * at[0] + at[-Q]) / ({{ upper }}_STEP * {{ upper }}_STEP);
        sum += kernel[half - k] * value * value;
    }
    return sum;
}

/* A value that grows with another slope above the largest of training. */
static double rising(double value, double top, double slope)
{
    return value > top ? top + slope * (value - top) : value;
}

{% endif %}
{% if follows %}
{{ array("surge_taps", follows.place.taps) }}
{% for bank in follows.banks(none) %}
{{ array("carriers_%d" % bank.column, bank.taps) }}
{% endfor %}
/* Elevation at a place of the grid; u is the first row that a carrier reads. */
static double carried(const double *u, const double *taps, int place, int probes, const int *probe)
{
    double sum = 0.0;
    taps += place * probes * TAPS;
    for (int c = 0; c < probes; c++)
        for (int i = 0; i < TAPS; i++)
            sum += *taps++ * u[i * Q + probe[c]];
    return sum;
}

{% endif %}
{% if lines %}
/* Load of a line: its regression on motions and on elevation and rate of the wave there, blended
   with the forecast of the load itself where they leave the range of training. */
typedef struct {
    int column, count;
    const int *columns;
    const double *mean, *std, *low, *high, *knots, *weights;
} load_map;

static double load(const load_map *map, const double *x, double elevation, double rate, double least, double most)
{
    double apart = 1.0, sum = map->weights[0], value = 0.0, surge = 0.0, wave = 0.0;
    const double *weight = map->weights + 1;
    for (int i = 0; i < map->count + 2; i++) {
        double v = i < map->count ? x[map->columns[i]] : i == map->count ? elevation : rate;
        apart += pow(fmax(fmax(map->low[i] - v, v - map->high[i]), 0.0) / ({{ soft | hex }} * map->std[i]), 2.0);
        value = (v - map->mean[i]) / map->std[i];
        if (i < map->count)
            sum += *weight++ * value;
        if (i == 0)
            surge = value;
        if (i == map->count)
            wave = value;
    }
    for (int i = 0; i < {{ lines[0][0].knots | length }}; i++)
        sum += *weight++ * fmax(surge - map->knots[i], 0.0);
    sum += *weight++ * wave;
    sum += *weight++ * value;
    sum += *weight++ * fabs(value);
    sum += *weight++ * (wave * wave);
    sum += *weight++ * (wave * value);
    sum += *weight++ * fmax(wave - 0.5, 0.0);
    for (int i = 0; i < 3; i++) {
        double wet = fmin(fmax((wave - 0.5 * i) / 0.5, 0.0), 1.0);
        sum += *weight++ * (wet * value);
        sum += *weight++ * (wet * fabs(value));
    }
    return x[map->column] + (fmin(fmax(sum, least), most) - x[map->column]) / apart;
}

{% endif %}
/* What has delays, of the inputs u of an instant. */
static void observe(const double *u, double *v)
{
{% for each in delayed %}
    v[{{ loop.index0 }}] = {{ each }};
{% endfor %}
    (void)u, (void)v;
}

void {{ name }}_regressors(const double *inputs, const double *surge, double *v, double *direct)
{
    const double *u = inputs + NOW * Q;
{% if follows %}
    double here = 0.0, on_grid, sides[2][DELAYED];
    for (int i = 0; i < PAST; i++)
        here += surge_taps[i] * surge[i];
    here = fmin(fmax(here, {{ follows.place.lowest | hex }}), {{ follows.place.grid[-1] | hex }});
    on_grid = (here - {{ follows.place.lowest | hex }}) / {{ follows.place.spacing | hex }};
    int below = (int)fmin(on_grid, PLACES - 2);
    for (int side = 0; side < 2; side++) {
        double at[Q];
        memcpy(at, u, sizeof at);
{% for bank in follows.banks(none) %}
        static const int probes_{{ bank.column }}[] = { {{ bank.columns | join(", ") }} };
        at[{{ bank.column }}] = carried(u - BACK * Q, carriers_{{ bank.column }}, below + side, {{ bank.columns | length }}, probes_{{ bank.column }});
{% endfor %}
        observe(at, sides[side]);
    }
    for (int i = 0; i < DELAYED; i++)
        v[i] = sides[0][i] + (on_grid - below) * (sides[1][i] - sides[0][i]);
{% else %}
    observe(u + {{ signature.input_map.lead }} * Q, v);
    (void)surge;
{% endif %}
{% for each in direct %}
    direct[{{ loop.index0 }}] = {{ each }};
{% endfor %}
{% if follows %}
    direct[DIRECT - 1] = pow(here - {{ follows.place.centre | hex }}, 2.0);
{% endif %}
    (void)u, (void)direct;
}

/* Take one more row of inputs, and make the regressors of the next step. */
static void push({{ name }}_model *m, const double *u)
{
    double *v = m->regressors + EXTENDED, *direct = v + DELAYED * (DELAYS + 1);
    double *newest = m->inputs + (WINDOW - 1) * Q;
    memmove(m->inputs, m->inputs + Q, (WINDOW - 1) * Q * sizeof(double));
    memmove(v + DELAYED, v, DELAYS * DELAYED * sizeof(double));
    for (int i = 0; i < Q; i++)
        newest[i] = u[i];
    {{ name }}_regressors(m->inputs, {{ "m->surge" if follows else "0" }}, v, direct);
    for (int i = 0; i < DELAYED; i++)
        v[i] = (v[i] - delayed_mean[i]) / delayed_std[i];
    for (int i = 0; i < DIRECT; i++)
        direct[i] = (direct[i] - direct_mean[i]) / direct_std[i];
}

/* Remember how far inputs go beyond those of training; each step forgets a little of it. */
static void widen({{ name }}_model *m, int delays)
{
    const double *v = m->regressors + EXTENDED, *direct = v + DELAYED * (DELAYS + 1);
    for (int i = 0; i < DELAYED * (delays + 1); i++) {
        int c = i % (DELAYED > 0 ? DELAYED : 1);
        double value = delayed_mean[c] + delayed_std[c] * v[i];
        m->excess = fmax(m->excess, fabs(value - delayed_centre[c]) / delayed_reach[c]);
    }
    for (int i = 0; i < DIRECT{{ " - 1" if follows }}; i++) {
        double value = direct_mean[i] + direct_std[i] * direct[i];
        m->excess = fmax(m->excess, fabs(value - direct_centre[i]) / direct_reach[i]);
    }
}

static int all_finite(const double *values, int count)
{
    for (int i = 0; i < count; i++)
        if (!(fabs(values[i]) <= DBL_MAX))
            return 0;
    return 1;
}

int {{ name }}_start({{ name }}_model *m, const double *x_history, const double *u_history)
{
    if (!all_finite(x_history, {{ upper }}_X_ROWS * N) || !all_finite(u_history, {{ upper }}_U_ROWS * Q))
        return 1;
    memset(m, 0, sizeof *m);
    m->excess = 1.0;
    const double *last = x_history + ({{ upper }}_X_ROWS - 1) * N;
    for (int i = 0; i < N; i++) {
        m->x[i] = last[i];
        m->limit[i] = state_reach[i];
        for (int row = 0; row < {{ upper }}_X_ROWS; row++) {
            double value = last[i - row * N];
            if (row * N < EXTENDED)
                m->regressors[row * N + i] = (value - state_mean[i]) / state_std[i];
            m->limit[i] = fmax(m->limit[i], fabs(value - state_centre[i]));
        }
    }
    for (int row = 0; row < {{ upper }}_U_ROWS; row++) {
{% if follows %}
        int before = {{ upper }}_U_ROWS - row;
        for (int i = 0; before <= DELAYS && i < PAST; i++)
            m->surge[i] = last[SURGE - (before + i) * N];
{% endif %}
        push(m, u_history + row * Q);
    }
{% if follows %}
    for (int i = 0; i < PAST; i++)
        m->surge[i] = last[SURGE - i * N];
{% endif %}
    if (DELAYS > 0)
        widen(m, DELAYS - 1);
    return 0;
}

int {{ name }}_step({{ name }}_model *m, const double *u)
{
    double next[ROWS], x[N];
    int lost = 0;
    if (!all_finite(u, Q))
        return 1;
    push(m, u);
    m->excess = 1.0 + {{ fade | hex }} * (m->excess - 1.0);
    widen(m, 0);
    for (int row = 0; row < ROWS; row++) {
        const double *weights = coefficients + row * COLUMNS;
        next[row] = 0.0;
        for (int i = 0; i < COLUMNS; i++)
            next[row] += weights[i] * m->regressors[i];
    }
    memmove(m->regressors + ROWS, m->regressors, (EXTENDED - ROWS) * sizeof(double));
    memcpy(m->regressors, next, sizeof next);
    for (int i = 0; i < N; i++) {
        x[i] = state_mean[i] + state_std[i] * next[i];
        if (!(fabs(x[i] - state_centre[i]) <= {{ growth }} * m->limit[i] * m->excess))
            lost = 1;
    }
{% if follows %}
    memmove(m->surge + 1, m->surge, (PAST - 1) * sizeof(double));
    m->surge[0] = x[SURGE];
{% endif %}
    for (int i = 0; lost && i < N; i++)
        x[i] = m->regressors[i] = NAN;
    memcpy(m->x, x, sizeof x);
{% for map, taps in lines %}
    {
{% for name in ("mean", "std", "low", "high", "knots", "weights") %}
        static const double {{ name }}[] = {
{{ map[name] | numbers }}
        };
{% endfor %}
        static const double taps[] = {
{{ taps | numbers }}
        };
        static const int columns[] = { {{ map.columns | join(", ") }} }, probes[] = { {{ follows.placed | join(", ") }} };
        static const load_map line = {
            {{ map.column }}, {{ map.columns | length }}, columns, mean, std, low, high, knots, weights
        };
        const double *first = m->inputs + (NOW - BACK) * Q;
        if (!lost)
            m->x[{{ map.column }}] = load(&line, x, carried(first, taps, 0, {{ follows.placed | length }}, probes),
                                carried(first, taps, 1, {{ follows.placed | length }}, probes),
                                {{ map.span[0] | hex }}, {{ map.span[1] | hex }});
    }
{% endfor %}
{% for each in readouts %}
    m->x[{{ each.column }}] = lost ? NAN : fmax(m->x[{{ each.column }}], {{ each.floor | hex }});
{% endfor %}
    return lost ? 2 : 0;
}

void {{ name }}_derivative(const {{ name }}_model *m, const double *u, const double *change, double *response)
{
    {{ name }}_model sides[2];
    double most = 0.0, row[Q + 1];
    for (int q = 0; q < Q; q++)
        most = fmax(most, fabs(change[q]) / delayed_std[q]);
    most = most > 0.0 ? {{ 1e-3 | hex }} / most : 0.0;
    for (int side = 0; side < 2; side++) {
        for (int q = 0; q < Q; q++)
            row[q] = u[q] + (side ? most : -most) * change[q];
        sides[side] = *m;
        {{ name }}_step(&sides[side], row);
    }
    for (int i = 0; i < N; i++)
        response[i] = most > 0.0 ? (sides[1].x[i] - sides[0].x[i]) / (2.0 * most) : 0.0;
}

{% from "facts.jinja" import N, Q, z, signature, past, upper, follows, late, fore, lead_samples, array with context %}
{% set coverage = model.coverage %}
/* {{ mark }} C source; see {{ name }}_estimator.h */
#include "{{ name }}_estimator.h"

#include <float.h>
#include <math.h>
#include <string.h>

enum {
    N = {{ upper }}_STATES,
    Q = {{ upper }}_INPUTS,
    M = {{ upper }}_EXTENDED,
    OLD = M - N,                /* entries of the covariance before those of this instant */
    DELAYED = {{ upper }}_DELAYED,
    DIRECT = {{ upper }}_DIRECT,
    DELAYS = {{ z }},
    ROWS = {{ late + z + 1 }},                  /* of delayed regressors */
    X_ROWS = {{ upper }}_ESTIMATES,
    LATE = {{ late }},                  /* samples whose estimates waves to come still move */
    RECORD = {{ upper }}_RECORD,
    BEGINS = {{ model.history_samples }},      /* samples before the first prediction */
    LEADS = {{ model.errors.longest }},
    SETTLED = LEADS + OLD / N,  /* samples without a measurement after which errors stay as they are */
    FORE = {{ fore }},                  /* inputs that are predicted before each is from its own record */
    GAP = {{ gap }},
    AFTER = {{ after }},
    PAST = {{ upper }}_U_ROWS - {{ lead_samples }},     /* rows of inputs that a forecast starts with, but the last */
    RUNS = 1 + 2 * {{ waves | length }}             /* of expected waves, and of departures from each */
};

/* x' = offset + on_states [x, oldest first] + on_inputs [v, oldest first] + on_direct [w] */
{{ array("on_states", a) }}
{{ array("on_inputs", b) -}}
{{ array("on_direct", d) }}
{{ array("offset", offset) -}}
{{ array("process", process) -}}
{{ array("raised", raised) -}}
{{ array("noise", noise) -}}
{{ array("centre", signature.state_scale.centre) -}}
{{ array("spread", signature.state_scale.spread) }}
/* RMS of third differences of inputs and states at least; infinite where they may jump. */
{{ array("smoothest", smoothest) }}
/* Errors of free runs in training, a row per sample after the start. */
{{ array("errors", model.errors.rms) }}
/* Inputs that are predicted; the others stay at their last value. */
static const int waves[] = { {% for q in range(Q) %}{{ 1 if q in waves else 0 }}, {% endfor %}0 };
static const int wave[] = { {% for q in waves %}{{ q }}, {% endfor %}0 };
{% if follows %}
/* Weights that predict placed probes from themselves and those up-wave: row, probe, probe, sample, oldest first. */
{{ array("foresight", foresight) -}}
{{ array("input_mean", signature.input_scale.mean) }}
static const int placed[] = { {{ follows.placed | join(", ") }} };
enum { PLACED = {{ follows.placed | length }}, TAPS = {{ foresight.shape[3] }} };

{% endif %}
/* Waves of training: shares of energy by band, heights and steepnesses. */
{{ array("shares", coverage.shares) -}}
{{ array("heights", coverage.heights) -}}
{{ array("steepnesses", coverage.steepnesses) -}}
{{ array("lows", coverage.lows) -}}
{{ array("highs", coverage.highs) }}
#define TRAINED {{ validity.TRAINED | hex }}
enum { BANDS = {{ coverage.shares.shape[1] }} };

#define PI 3.14159265358979323846
#define P(i, j) e->covariance[(i) * M + (j)]

/* Inputs so many samples before the newest of the record, or after it. */
static double *input({{ name }}_estimator *e, int back)
{
    return (e->is_planned ? e->planned : e->inputs) + (RECORD - 1 - back) * Q;
}

/* One step in time; without a prediction the newest sample is independent of those before. */
static void shift({{ name }}_estimator *e, int is_predicted)
{
    double block[N * N];
    double *top = e->cross;
    for (int i = 0; i < N; i++)
        for (int j = 0; j < M; j++) {
            double sum = 0.0;
            for (int k = 0; k < M; k++)
                sum += on_states[i * M + k] * P(k, j);
            top[i * M + j] = sum;
        }
    for (int i = 0; i < N; i++)
        for (int j = 0; j < N; j++) {
            block[i * N + j] = process[i * N + j];
            for (int k = 0; k < M; k++)
                block[i * N + j] += top[i * M + k] * on_states[j * M + k];
        }
    for (int i = 0; i < OLD; i++)
        memmove(e->covariance + i * M, e->covariance + (i + N) * M + N, OLD * sizeof(double));
    for (int i = 0; i < N; i++) {
        for (int j = 0; j < OLD; j++)
            P(OLD + i, j) = P(j, OLD + i) = is_predicted ? top[i * M + N + j] : 0.0;
        for (int j = 0; j < N; j++)
            P(OLD + i, OLD + j) = is_predicted ? 0.5 * (block[i * N + j] + block[j * N + i])
                                  : i == j     ? spread[i] * spread[i]
                                               : 0.0;
    }
}

/* Errors never exceed those of a free run, and without a measurement they are these. */
static void limit({{ name }}_estimator *e, int blind)
{
    double factor[N];
    const double *most = errors + (e->since < LEADS ? e->since : LEADS - 1) * N;
    for (int i = 0; i < N; i++) {
        factor[i] = sqrt(most[i] * most[i] / fmax(P(OLD + i, OLD + i), DBL_MIN));
        if (!blind)
            factor[i] = fmin(factor[i], 1.0);
    }
    for (int i = 0; i < N; i++) {
        for (int j = 0; j < OLD; j++)
            P(j, OLD + i) = P(OLD + i, j) *= factor[i];
        for (int j = 0; j < N; j++)
            P(OLD + i, OLD + j) *= factor[i] * factor[j];
    }
}

/* Gain of the rows that were measured, and the covariance after it. */
static void measure({{ name }}_estimator *e, const int *rows, int count)
{
    double root[N * N];
    double *gain = e->gains[e->slot], *cross = e->cross;
    for (int i = 0; i < M; i++)
        for (int c = 0; c < count; c++)
            cross[i * N + c] = P(i, OLD + rows[c]);
    for (int i = 0; i < count; i++) /* Cholesky's factor of the innovation's covariance */
        for (int j = 0; j <= i; j++) {
            double sum = cross[(OLD + rows[i]) * N + j] + (i == j ? noise[rows[i]] : 0.0);
            for (int k = 0; k < j; k++)
                sum -= root[i * N + k] * root[j * N + k];
            root[i * N + j] = i == j ? sqrt(sum) : sum / root[j * N + j];
        }
    for (int i = 0; i < M; i++) {
        double *row = gain + i * N;
        for (int c = 0; c < count; c++) {
            row[c] = cross[i * N + c];
            for (int k = 0; k < c; k++)
                row[c] -= root[c * N + k] * row[k];
            row[c] /= root[c * N + c];
        }
        for (int c = count - 1; c >= 0; c--) {
            for (int k = c + 1; k < count; k++)
                row[c] -= root[k * N + c] * row[k];
            row[c] /= root[c * N + c];
        }
    }
    for (int i = 0; i < M; i++)
        for (int j = 0; j <= i; j++) {
            double less = 0.0;
            for (int c = 0; c < count; c++)
                less += gain[i * N + c] * cross[j * N + c] + gain[j * N + c] * cross[i * N + c];
            P(i, j) = P(j, i) = P(i, j) - 0.5 * less;
        }
    for (int c = 0; c < count; c++)
        for (int i = 0; noise[rows[c]] == 0.0 && i < M; i++)
            P(i, OLD + rows[c]) = P(OLD + rows[c], i) = 0.0;
}

/* A series about its mean under Hann's taper, whose zeros lie so many samples `beyond` its ends. */
static void taper(const double *series, int size, int beyond, double *out)
{
    double mean = 0.0;
    for (int t = 0; t < size; t++)
        mean += series[t] / size;
    for (int t = 0; t < size; t++)
        out[t] = (series[t] - mean) * (0.5 - 0.5 * cos(2.0 * PI * (t + beyond) / (size - 1 + 2 * beyond)));
}

/* Power of a series at k cycles (Goertzel 1958). */
static double power(const double *series, int size, int k)
{
    double rate = 2.0 * cos(2.0 * PI * k / size), one = 0.0, two = 0.0;
    for (int t = 0; t < size; t++) {
        double next = series[t] - two + rate * one;
        two = one;
        one = next;
    }
    return one * one + two * two - rate * one * two;
}

/* Frequency, in cycles of the series, below which half of its variance lies. */
static double median_frequency(const double *series, int size, double *tapered)
{
    double square = 0.0, even = 0.0, sum = 0.0, total, grown = 0.0;
    taper(series, size, 1, tapered);
    for (int t = 0; t < size; t++) {
        square += tapered[t] * tapered[t];
        even += t % 2 ? -tapered[t] : tapered[t];
        sum += tapered[t];
    }
    /* By Parseval: half of the sum over the frequencies from zero on. */
    total = 0.25 * (size * square + sum * sum + (size % 2 ? 0.0 : even * even));
    for (int k = 0; k <= size / 2; k++) {
        grown += power(tapered, size, k);
        if (grown >= total)
            return k * (1.0 / size); /* rounded as in NumPy: orders may lie at halves */
    }
    return 0.5;
}

/* Autoregressive model of the record of an input (Burg 1975), and of rows after it, over its last
 * four periods. */
static void identify({{ name }}_estimator *e, int q, int rows)
{
    double *forward = e->forward, *backward = e->backward, *filter = e->filter[q];
    double mean = 0.0, least = INFINITY, most = -INFINITY, square = 0.0, part = 1.0;
    int size = e->filled + rows, order = 1;
    for (int t = 0; t < size; t++) {
        double value = input(e, e->filled - 1 - t)[q];
        mean += value / size;
        least = fmin(least, value);
        most = fmax(most, value);
    }
    for (int t = 0; t < size; t++) {
        backward[t] = input(e, e->filled - 1 - t)[q] - mean;
        square += backward[t] * backward[t];
    }
    if (most > least)
        order = (int)rint({{ prediction.MEMORY }} / fmax(median_frequency(backward, size, forward), 1.0 / size));
    order = order > size / 3 ? size / 3 : order;
    order = order < 1 ? 1 : order;
    e->mean[q] = mean;
    e->order[q] = order;
    for (int i = 0; i < order; i++)
        e->past[q][i] = backward[size - 1 - i];
    memcpy(forward, backward + 1, (size - 1) * sizeof(double));
    memset(filter, 0, (order + 1) * sizeof(double));
    filter[0] = 1.0;
    for (int m = 0; m < order; m++) {
        double power = 0.0, both = 0.0, reflection;
        int left = size - 1 - m;
        for (int t = 0; t < left; t++) {
            power += forward[t] * forward[t] + backward[t] * backward[t];
            both += forward[t] * backward[t];
        }
        if (power <= DBL_EPSILON * square)
            break;
        reflection = -2.0 * both / (power + 2.0 * {{ prediction.NOISE | hex }} * square / size * left);
        part *= 1.0 - reflection * reflection;
        for (int t = 0; t < left; t++) {
            double ahead = forward[t] + reflection * backward[t];
            backward[t] += reflection * forward[t];
            if (t > 0)
                forward[t - 1] = ahead;
        }
        for (int i = 0; 2 * i <= m + 1; i++) {
            double low = filter[i], high = filter[m + 1 - i];
            filter[i] = low + reflection * high;
            filter[m + 1 - i] = high + reflection * low;
        }
    }
    e->innovation_of[q] = sqrt(square / size * part * (size + order) / (size - order));
}

/* What an innovation makes of an input that was identified, after a past about its mean. */
static double continued({{ name }}_estimator *e, int q, double *past, double innovation)
{
    for (int i = 0; i < e->order[q]; i++)
        innovation -= e->filter[q][i + 1] * past[i];
    memmove(past + 1, past, (e->order[q] - 1) * sizeof(double));
    return past[0] = innovation;
}

/* Predict rows of inputs, FORE at most. */
static void expect({{ name }}_estimator *e, int rows)
{
    double *out = input(e, -1);
    for (int q = 0; q < Q; q++) {
{% if follows %}
        int place = 0;
        while (place < PLACED && placed[place] != q)
            place++;
        for (int row = 0; place < PLACED && e->taken >= BEGINS && row < rows; row++) {
            const double *taps = foresight + (row * PLACED + place) * PLACED * TAPS;
            double sum = input_mean[q];
            for (int p = 0; p < PLACED; p++)
                for (int i = 0; i < TAPS; i++)
                    sum += *taps++ * (input(e, TAPS - 1 - i)[placed[p]] - input_mean[placed[p]]);
            out[row * Q + q] = sum;
        }
        if (place < PLACED && e->taken >= BEGINS)
            continue;
{% endif %}
        if (waves[q])
            identify(e, q, 0);
        for (int row = 0; row < rows; row++)
            out[row * Q + q] = waves[q] ? e->mean[q] + continued(e, q, e->past[q], 0.0) : input(e, 0)[q];
    }
}

/* Regressors of the step from a sample so many before the newest. */
static void drive({{ name }}_estimator *e, int back, double *direct)
{
    double surge[{{ [past, 1] | max }}] = { 0.0 };
{% if follows %}
    for (int i = 0; i < {{ past }}; i++)
        surge[i] = e->x[(X_ROWS - 1 - back - i) * N + {{ follows.column }}];
{% endif %}
    {{ name }}_regressors(input(e, back + {{ upper }}_NOW), surge, e->delayed + (ROWS - back) * DELAYED, direct);
}

/* Run the mean to a sample so many before the newest, with the gains that were found for it. */
static void advance({{ name }}_estimator *e, double *x, int back, int is_final)
{
    double next[N], direct[DIRECT + 1];
    int slot = (e->slot - back + LATE + 1) % (LATE + 1);
    const double *y = e->y[slot];
    memcpy(next, centre, sizeof next);
    if (e->taken >= BEGINS) {
        drive(e, back + 1, direct);
        for (int i = 0; i < N; i++) {
            next[i] = offset[i];
            for (int k = 0; k < M; k++)
                next[i] += on_states[i * M + k] * x[k];
            for (int k = 0; k < (DELAYS + 1) * DELAYED; k++)
                next[i] += on_inputs[i * (DELAYS + 1) * DELAYED + k]
                           * e->delayed[(LATE - back) * DELAYED + k];
            for (int k = 0; k < DIRECT; k++)
                next[i] += on_direct[i * DIRECT + k] * direct[k];
        }
    }
    memmove(x, x + N, OLD * sizeof(double));
    memcpy(x + OLD, next, sizeof next);
    for (int c = 0, column = 0; c < N; c++) {
        if (!isnan(y[c])) {
            for (int i = 0; !e->plain[slot] && i < M; i++)
                x[i] += e->gains[slot][i * N + column] * (y[c] - next[c]);
            column++;
        }
        if (is_final)
            e->innovation[c] = y[c] - next[c];
    }
    for (int c = 0; c < N; c++)
        if (!isnan(y[c]) && noise[c] == 0.0)
            x[OLD + c] = y[c];
    memcpy(e->x + (X_ROWS - 1 - back) * N - OLD, x, M * sizeof(double));
}

/* Regressors of the samples before the first prediction. */
static void drive_before({{ name }}_estimator *e, int back)
{
    double direct[DIRECT + 1];
    for (int i = DELAYS; i > 0; i--)
        drive(e, back + i, direct);
}

/* Bring estimates up to the newest sample: final ones, then those that waves to come move. */
static void settle({{ name }}_estimator *e)
{
    double *x = e->ahead;
    int plain = 1;
    if (e->taken < BEGINS) {
        advance(e, e->history, 0, 1);
        return;
    }
    e->pending++;
    if (e->pending > LATE) {
        if (!e->begun)
            drive_before(e, e->pending);
        e->begun = 1;
        advance(e, e->history, LATE, 1);
        e->pending = LATE;
    }
    for (int back = 0; back < e->pending; back++)
        plain = plain && e->plain[(e->slot - back + LATE + 1) % (LATE + 1)];
    if (plain) {
        if (e->pending)
            memcpy(e->x + (X_ROWS - 1) * N, e->y[e->slot], N * sizeof(double));
        return;
    }
    if (Q > 0)
        expect(e, {{ lead_samples }});
    if (!e->begun)
        drive_before(e, e->pending);
    memcpy(x, e->history, sizeof e->history);
    for (int back = e->pending - 1; back >= 0; back--)
        advance(e, x, back, 0);
}

/* Take as lost what jumps: far above those of late in the third difference from the last three taken. */
static void smooth({{ name }}_estimator *e, double *sample)
{
    e->doubtful -= e->doubtful > 0;
    for (int i = 0; i < Q + N; i++) {
        double *x = e->last[i], *age = e->age[i], a = ++age[0], b = ++age[1], c = ++age[2];
        double away = sample[i] - x[0] * (b * c) / ((b - a) * (c - a)), usual;
        int jumps;
        away -= x[1] * (a * c) / ((a - b) * (c - b)) + x[2] * (a * b) / ((a - c) * (b - c));
        away = fabs(6.0 / (a * b * c) * away);
        usual = fmax(sqrt(e->squares[i] / fmax(e->weight[i], 1.0)), smoothest[i]);
        jumps = away > {{ prediction.JUMP | hex }} * usual && e->weight[i] >= {{ prediction.FEWEST }};
        if ((c == 3.0 || jumps) && !isnan(sample[i]) && !isinf(smoothest[i])) {
            e->squares[i] *= 1.0 - 1.0 / {{ prediction.OF_LATE | float }};
            e->weight[i] *= 1.0 - 1.0 / {{ prediction.OF_LATE | float }};
            e->squares[i] += pow(fmin(away, {{ (0.5 * prediction.JUMP) | hex }} * usual), 2.0);
            e->weight[i] += 1.0;
        }
        if (jumps) {
            sample[i] = NAN;
            e->doubtful = i < Q ? e->doubtful : {{ doubtful }};
        } else if (!isnan(sample[i])) {
            memmove(x + 1, x, 2 * sizeof(double));
            memmove(age + 1, age, 2 * sizeof(double));
            x[0] = sample[i];
            age[0] = 0.0;
        }
    }
}

int {{ name }}_estimate({{ name }}_estimator *e, const double *u, const double *y)
{
    double sample[Q + N], *newest = e->x + (X_ROWS - 1) * N;
    int rows[N], count = 0, exact = 1, lost = 0, plain;
    for (int i = 0; i < N; i++)
        if (isinf(y[i]))
            return 1;
    for (int q = 0; q < Q; q++)
        if (isinf(u[q]) || (isnan(u[q]) && e->filled < 4))
            return 1;
    if (e->taken == 0) {
        e->partly = 1;
        for (int i = 0; i < M; i++)
            e->history[i] = centre[i % N];
        for (int i = 0; i < Q + N; i++)
            for (int k = 0; k < 3; k++)
                e->age[i][k] = NAN;
    }
    memcpy(sample, u, Q * sizeof(double));
    memcpy(sample + Q, y, N * sizeof(double));
    smooth(e, sample);
    y = sample + Q;
    for (int i = 0; i < N; i++) {
        exact = exact && noise[i] == 0.0;
        if (!isnan(y[i]))
            rows[count++] = i;
    }
    for (int q = 0; q < Q; q++)
        lost = lost || isnan(sample[q]);
    if (lost)
        expect(e, 1);
    e->slot = (e->slot + 1) % (LATE + 1);
    memcpy(e->y[e->slot], y, N * sizeof(double));
    memmove(e->inputs, e->inputs + Q, (RECORD - 1) * Q * sizeof(double));
    memmove(e->lost, e->lost + Q, (RECORD - 1) * Q);
    for (int q = 0; q < Q; q++) {
        int row = (RECORD - 1) * Q + q;
        e->lost[row] = isnan(sample[q]) != 0;
        e->inputs[row] = e->lost[row] ? e->inputs[RECORD * Q + q] : sample[q];
    }
    e->filled += e->filled < RECORD;
    memmove(e->delayed, e->delayed + DELAYED, (ROWS - 1) * DELAYED * sizeof(double));
    memmove(e->x, e->x + N, (X_ROWS - 1) * N * sizeof(double));
    for (int c = 0; c < count; c++)
        newest[rows[c]] = y[rows[c]];
    exact = exact && count == N;
    plain = exact && e->since == 0 && e->taken >= BEGINS;
    e->plain[e->slot] = plain;
    if (!plain) {
        int blind = !(e->partly || count);
        if (!blind || e->since < SETTLED) {
            shift(e, e->taken >= BEGINS);
            if (e->taken >= BEGINS)
                limit(e, blind);
        }
        measure(e, rows, count);
    }
    e->unseen = count ? 0 : e->unseen + (e->unseen < RECORD);
    e->complete = exact ? (e->complete < M ? e->complete + 1 : M) : 0;
    if (e->complete * N > OLD) {
        e->since = e->partly = 0;
        memset(e->covariance, 0, sizeof e->covariance);
    } else if (!plain) {
        e->since += e->since < SETTLED;
        e->partly = e->partly || count;
    }
    settle(e);
{% if "surge" in signature.states %}
    memmove(e->surge, e->surge + 1, (RECORD - 1) * sizeof(double));
    e->surge[RECORD - 1] = newest[{{ signature.states.index("surge") }}];
{% endif %}
    e->taken += e->taken < BEGINS;
    return 0;
}

/* The next row on from this one, forwards or backwards, in which an input was measured. */
static int measured(const {{ name }}_estimator *e, int row, int by, int q)
{
    while (row >= RECORD - e->filled && row < RECORD && e->lost[row * Q + q])
        row += by;
    return row;
}

/* Whether an input was not measured, in a gap that is not closed. */
static int is_lost(const {{ name }}_estimator *e, int row, int q)
{
    int first = RECORD - e->filled, before = row, after = row;
    while (after - before <= GAP + 1 && before >= first && e->lost[before * Q + q])
        before--;
    while (after - before <= GAP + 1 && after < RECORD && e->lost[after * Q + q])
        after++;
    return before < first || after == RECORD || after - before > GAP + 1;
}

/* Whether no wave is known in a row. */
static int is_dark(const {{ name }}_estimator *e, int row)
{
    int dark = RUNS > 1;
    for (int q = 0; q < Q; q++)
        dark = dark && (!waves[q] || is_lost(e, row, q));
    return dark;
}

/* Rows at the end of the record in which no wave is known. */
static int dark_rows(const {{ name }}_estimator *e)
{
    int rows = 0;
    while (rows < e->filled && is_dark(e, RECORD - 1 - rows))
        rows++;
    return rows;
}

/* Copy the record into `planned` and close its short gaps, by a cubic through two measured rows on
 * either side. */
static void close_gaps({{ name }}_estimator *e)
{
    memcpy(e->planned, e->inputs, RECORD * Q * sizeof(double));
    for (int row = RECORD - e->filled; row < RECORD; row++)
        for (int q = 0; q < Q; q++) {
            int near[4], count = 2;
            double value = 0.0;
            if (!waves[q] || !e->lost[row * Q + q] || is_lost(e, row, q))
                continue;
            near[0] = measured(e, row, -1, q);
            near[1] = measured(e, row, 1, q);
            if ((near[count] = measured(e, near[0] - 1, -1, q)) >= RECORD - e->filled)
                count++;
            if ((near[count] = measured(e, near[1] + 1, 1, q)) < RECORD)
                count++;
            for (int i = 0; i < count; i++) {
                double part = e->inputs[near[i] * Q + q];
                for (int k = 0; k < count; k++)
                    if (k != i)
                        part *= (double)(row - near[k]) / (near[i] - near[k]);
                value += part;
            }
            e->planned[row * Q + q] = value;
        }
    e->is_planned = 1;
}

int {{ name }}_validity({{ name }}_estimator *e)
{
    int size = e->filled, outside = e->doubtful ? {{ upper }}_CONSISTENCY : 0;
    int back = BEGINS + (e->since < LEADS ? e->since : LEADS), tail = dark_rows(e);
    tail = tail <= e->unseen ? tail : 0; /* the band holds what comes of it */
    for (int row = RECORD - (size < back ? size : back); row < RECORD - tail; row++)
        for (int q = 0; q < Q; q++)
            if (waves[q] && is_lost(e, row, q))
                outside |= {{ upper }}_LOST;
    for (int q = 0; size >= 4 && q < Q; q++) {
        double mean = 0.0, square = 0.0, fourth = 0.0, sum = 0.0, grown = 0.0;
        double energy[BANDS] = { 0.0 }, total = 0.0, unseen = 0.0, height, steepness, repeats, margin;
        const double *taught = shares + q * BANDS;
        int peak = 0, moves = 0;
        for (int t = 0; t < size; t++)
            mean += input(e, t)[q] / size;
        if (size > 8 * GAP && (mean < lows[q] || mean > highs[q]))
            outside |= {{ upper }}_MEAN;
        if (!waves[q])
            continue;
        for (int t = 0; t < size; t++) {
            double away = pow(input(e, t)[q] - mean, 2.0);
            square += away / size;
            fourth += away * away / size;
        }
        height = 4.0 * sqrt(fourth / (3.0 * fmax(square, DBL_MIN)));
        for (int t = 0; t < size; t++)
            e->backward[t] = input(e, size - 1 - t)[q];
        taper(e->backward, size, 0, e->forward);
        for (int k = 0; k <= size / 2; k++) {
            double here = power(e->forward, size, k);
            sum += here;
            grown += here * k / (size * {{ upper }}_STEP);
        }
        grown /= fmax(sum, DBL_MIN);
        steepness = {{ (2 * pi / gravity) | hex }} * height * grown * grown;
        taper(e->backward, size, 1, e->forward);
        for (int k = 1; k <= size / 2; k++) {
            int band = (int)floor({{ validity.PER_OCTAVE }} * log2(k / (size * {{ upper }}_STEP))) - ({{ coverage.first }});
            if (band >= 0 && band < BANDS)
                energy[band] += power(e->forward, size, k);
        }
        for (int band = 0; band < BANDS; band++) {
            int beside = taught[band] >= TRAINED || (band > 0 && taught[band - 1] >= TRAINED)
                         || (band + 1 < BANDS && taught[band + 1] >= TRAINED);
            total += energy[band];
            unseen += beside ? 0.0 : energy[band];
            peak = energy[band] > energy[peak] ? band : peak;
            moves = moves || taught[band] >= TRAINED;
        }
        repeats = size * {{ upper }}_STEP * pow(2.0, ({{ coverage.first }} + peak + 0.5) / {{ validity.PER_OCTAVE }});
        if (!moves || !(total > 0.0) || !(repeats > {{ validity.CYCLES }}))
            continue;
        margin = 1.1 + 1.7 / sqrt(repeats);
        if (unseen > 0.5 * total
                && (isfinite(steepnesses[q]) || height > {{ validity.STILL }} * heights[q]))
            outside |= {{ upper }}_PERIOD;
        if (height > margin * heights[q])
            outside |= {{ upper }}_HEIGHT;
        if (steepness > margin * steepnesses[q])
            outside |= {{ upper }}_STEEPNESS;
    }
{% if "surge" in signature.states %}
    double surge = 0.0, away;
    for (int t = 0; t < size; t++)
        surge += e->surge[RECORD - 1 - t] / size;
    away = surge - centre[{{ signature.states.index("surge") }}];
    if (size >= 4 && Q > 0 && fabs(away) > {{ signature.state_scale.reach[signature.states.index("surge")] | hex }})
        outside |= {{ upper }}_SURGE;
{% endif %}
    return outside;
}

const double *{{ name }}_estimated(const {{ name }}_estimator *e) { return e->x + (X_ROWS - 1) * N; }

double {{ name }}_deviation(const {{ name }}_estimator *e, int state)
{
    int since = e->since < 1 ? 1 : e->since < LEADS ? e->since : LEADS;
    double own = sqrt(P(OLD + state, OLD + state));
    return fmax(own, fmin(raised[state] * own, errors[(since - 1) * N + state]));
}

static int is_given(const double *future, int at, int q)
{
    return !waves[q] || (future && at >= 0 && !isnan(future[at * Q + q]));
}

/* Rows of the future, `most` of them, before the first in which a wave is not given. */
static int given_rows(const double *future, int most)
{
    for (int known = 0; known < most; known++)
        for (int q = 0; q < Q; q++)
            if (!is_given(future, known, q))
                return known;
    return most;
}

/* Put rows that are given behind the record, which waves after them are predicted from. */
static void plan({{ name }}_estimator *e, const double *future, int known)
{
    for (int row = 0; row < RECORD; row++) {
        int at = row + known - RECORD;
        double *out = e->planned + row * Q;
        for (int q = 0; q < Q; q++) {
            double last = row > 0 && at > 0 ? out[q - Q] : e->inputs[(RECORD - 1) * Q + q];
            if (at < 0)
                out[q] = out[known * Q + q];
            else
                out[q] = isnan(future[at * Q + q]) ? last : future[at * Q + q];
        }
    }
    e->filled = e->filled + known < RECORD ? e->filled + known : RECORD;
}

/* From the inputs of an instant those of the next one, which is so many after the first to come or
 * before it, and what one innovation of each wave, where it is first not known, adds to them. */
static void coming({{ name }}_estimator *e, const double *future, int known, int at, double *u,
                   double *apart)
{
    for (int q = 0; q < Q; q++) {
        apart[q] = 0.0;
        if (waves[q] && at >= known) {
            u[q] = at < known + FORE ? input(e, known - 1 - at)[q]
                                     : e->mean[q] + continued(e, q, e->past[q], 0.0);
            if (e->departs[q] || !is_given(future, at, q)) {
                double away = continued(e, q, e->apart[q], e->departs[q] ? 0.0 : e->innovation_of[q]);
                e->departs[q] = 1;
                apart[q] = is_given(future, at, q) ? 0.0 : away;
            }
        }
        if (at < 0 && !waves[q])
            u[q] = e->inputs[(RECORD + at) * Q + q];
        else if (at >= 0 && future && !isnan(future[at * Q + q]))
            u[q] = future[at * Q + q];
    }
}

/* Inputs of a run: as expected, or departing by the innovation of one wave, or by its opposite. */
static void depart(const double *u, const double *apart, int run, double *out)
{
    memcpy(out, u, Q * sizeof(double));
    if (run > 0)
        out[wave[(run - 1) / 2]] += (run % 2 ? 1.0 : -1.0) * apart[wave[(run - 1) / 2]];
}

/* Variance of a state that the errors of the estimate leave some steps later; `reach` are the rows
 * of the model that carry them there. */
static double carried_error(const {{ name }}_estimator *e, const double *reach)
{
    double sum = 0.0;
    for (int j = 0; j < M; j++)
        for (int k = 0; k < M; k++)
            sum += raised[j % N] * reach[j] * P(j, k) * reach[k] * raised[k % N];
    return sum;
}

/* One step more of the rows that carry errors of the estimate. */
static void reach_on(double *reach)
{
    for (int i = 0; i < N; i++) {
        double *row = reach + i * M, last[N];
        memcpy(last, row + OLD, sizeof last);
        memmove(row + N, row, OLD * sizeof(double));
        memset(row, 0, N * sizeof(double));
        for (int c = 0; c < N; c++)
            for (int k = 0; k < M; k++)
                row[k] += last[c] * on_states[c * M + k];
    }
}

/* Run from so many samples `back`; `dark` samples before the newest, waves are not known. After too
 * long without a measurement all is as in the mean of training. */
static int run_on({{ name }}_estimator *e, int n, const double *future, int known, int dark, int back,
                  int too_long, double *x, double *std)
{
    double u[Q + 1], apart[Q + 1] = { 0.0 }, row[Q + 1], moved[N] = { 0.0 }, spreads[N] = { 0.0 };
    const double *history = e->x + (X_ROWS - back - {{ upper }}_X_ROWS) * N;
    double weight[N], above[N], below[N], *reach = e->cross;
    int runs = known < n - 1 + {{ lead_samples }} ? RUNS : 1;
    if (runs > 1) {
        expect(e, FORE);
{% if follows %}
        for (int p = 0; p < PLACED; p++)
            identify(e, placed[p], FORE);
{% endif %}
    }
    memset(e->apart, 0, sizeof e->apart);
    memset(e->departs, 0, sizeof e->departs);
    memcpy(u, e->inputs + (RECORD - 1 - dark) * Q, Q * sizeof(double));
    for (int at = -dark; at < {{ lead_samples }} - 1 - back; at++) {
        int to = PAST + back + 1 + at;
        coming(e, future, known, at, u, apart);
        if (to >= 0) {
            memcpy(e->first + to * Q, u, Q * sizeof(double));
            memcpy(e->first_apart + to * Q, apart, Q * sizeof(double));
        }
    }
    for (int run = 0; run < runs; run++) {
        int from = PAST + back + 1 - dark;
        for (int to = from > 0 ? from : 0; to < {{ upper }}_U_ROWS; to++)
            depart(e->first + to * Q, e->first_apart + to * Q, run, e->u_history + to * Q);
        if ({{ name }}_start(&e->models[run], history, e->u_history))
            return 1;
    }
    for (int k = 0; k < {{ upper }}_X_ROWS * N; k++) {
        double away = history[k] - centre[k % N];
        above[k % N] = k < N ? away : fmin(above[k % N], away);
        below[k % N] = k < N ? -away : fmin(below[k % N], -away);
    }
    memcpy(reach, on_states, sizeof on_states);
    for (int i = 0; i < N; i++)
        weight[i] = too_long ? 0.0 : 1.0;
    for (int step = -back; step < n; step++) {
        int at = step > 0 ? step : 0;
        const double *own = errors + (at < LEADS ? at : LEADS - 1) * N;
        const double *bound = errors + (at + e->since < LEADS ? at + e->since : LEADS - 1) * N;
        if (step + {{ lead_samples }} > -dark)
            coming(e, future, known, step + {{ lead_samples }} - 1, u, apart);
        for (int run = 0; run < runs; run++) {
            depart(u, apart, run, row);
            if ({{ name }}_step(&e->models[run], row))
                return 2;
        }
        for (int i = 0; i < N; i++) {
            double middle = e->models[0].x[i], away = 0.0, variance;
            double usual = fmax(fmin(fabs(middle - centre[i]), fmax(above[i], below[i])), spread[i]);
            for (int run = 1; run < runs; run += 2) {
                double more = e->models[run].x[i], less = e->models[run + 1].x[i];
                moved[i] += 0.5 * (more + less) - middle;
                away += 0.5 * fabs(more - less);
            }
            spreads[i] += away * away;
            if (step < 0)
                continue;
            variance = bound[i] * bound[i];
            if (e->partly)
                variance = fmin(variance, own[i] * own[i] + carried_error(e, reach + i * M));
            variance += spreads[i];
            weight[i] = fmin(weight[i], fmax(({{ doubted[1] | hex }} - variance / (usual * usual))
                                             / {{ (doubted[1] - doubted[0]) | hex }}, 0.0));
            x[step * N + i] = middle + moved[i];
            if (runs > 1 && step > known - {{ lead_samples }}) {
                x[step * N + i] = centre[i] + weight[i] * (middle + moved[i] - centre[i]);
                variance = weight[i] * variance + (1.0 - weight[i]) * spread[i] * spread[i];
            }
            if (std)
                std[step * N + i] = sqrt(variance);
        }
        if (e->partly && step >= 0)
            reach_on(reach);
    }
    return 0;
}

int {{ name }}_forecast({{ name }}_estimator *e, int n, const double *future, double *x, double *std)
{
    int most = n - 1 + {{ lead_samples }}, known = given_rows(future, most), filled = e->filled, status;
    int tail = dark_rows(e), after, dark, back, unseen;
    if (e->taken < BEGINS)
        return 1;
    close_gaps(e);
    for (after = 0; after < filled - tail && !is_dark(e, RECORD - 1 - tail - after);)
        after++;
    dark = tail < LEADS ? tail : LEADS;
    unseen = tail < e->unseen ? tail : e->unseen;
    back = unseen < LEADS ? unseen : LEADS;
    back = back < filled - BEGINS ? back : filled - BEGINS;
    if (after >= AFTER) /* what filled a gap that is not closed does not join the waves after it */
        e->filled = after + tail;
    memcpy(e->u_history, e->planned + (RECORD - 1 - PAST - back) * Q,
           (PAST + ({{ lead_samples }} > back ? back + 1 : {{ lead_samples }})) * Q * sizeof(double));
    if (dark > 0) { /* waves are predicted from the record before */
        known = -dark;
        memmove(e->planned + dark * Q, e->planned, (RECORD - dark) * Q * sizeof(double));
        e->filled -= dark;
    } else if (future && known > 0 && known < most) {
        plan(e, future, known);
    }
    status = run_on(e, n, future, known, dark, back, unseen > LEADS, x, std);
    e->filled = filled;
    e->is_planned = 0;
    return status;
}

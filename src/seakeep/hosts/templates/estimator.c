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
    DELAYS = {{ z }},
    RECORD = {{ upper }}_RECORD,
    BEGINS = {{ begins }},      /* samples before the first prediction */
    LEADS = {{ errors | length }}
};

{% macro array(name, values) %}
static const double {{ name }}[] = {
{{ values | numbers }}
};
{% endmacro %}
/* x' = offset + on_states [x, oldest first] + on_inputs [u, oldest first] */
{{ array("on_states", a) }}
{{ array("on_inputs", b) }}
{{ array("offset", offset) -}}
{{ array("process", process) -}}
{{ array("noise", noise) -}}
{{ array("centre", centre) -}}
{{ array("spread", spread) }}
/* Errors of free runs in training, a row per sample after the start. */
{{ array("errors", errors) }}
#define P(i, j) e->covariance[(i) * M + (j)]

static const double *input(const {{ name }}_estimator *e, int back)
{
    return e->inputs + (e->newest - back + RECORD) % RECORD * Q;
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
    double *gain = e->gain, *cross = e->cross;
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

/* Frequency, in cycles of the series, below which half of its variance lies. */
static double median_frequency(const double *series, int size)
{
    const double pi = 3.14159265358979323846;
    double mean = 0.0, square = 0.0, even = 0.0, grown = 0.0, total = 0.0;
    for (int t = 0; t < size; t++)
        mean += series[t] / size;
    for (int k = -1; k <= size / 2; k++) {
        double rate = 2.0 * cos(2.0 * pi * k / size), one = 0.0, two = 0.0;
        for (int t = 0; t < size; t++) {
            double x = (series[t] - mean) * (0.5 - 0.5 * cos(2.0 * pi * (t + 1) / (size + 1)));
            double next = x + rate * one - two;
            two = one;
            one = next;
            if (k < 0) {
                square += x * x;
                even += t % 2 ? -x : x;
                grown += x;
            }
        }
        if (k < 0) { /* by Parseval: half of the sum over the frequencies from zero on */
            total = 0.25 * (size * square + grown * grown + (size % 2 ? 0.0 : even * even));
            grown = 0.0;
            continue;
        }
        grown += one * one + two * two - rate * one * two;
        if (grown >= total)
            return (double)k / size;
    }
    return 0.5;
}

/* Autoregressive model of the record of an input (Burg 1975), over its last four periods. */
static void identify({{ name }}_estimator *e, int q)
{
    double *forward = e->forward, *backward = e->backward, *filter = e->filter[q];
    double mean = 0.0, least = INFINITY, most = -INFINITY, square = 0.0;
    int size = e->filled, order = 1;
    for (int t = 0; t < size; t++) {
        double value = input(e, size - 1 - t)[q];
        mean += value / size;
        least = fmin(least, value);
        most = fmax(most, value);
    }
    for (int t = 0; t < size; t++) {
        backward[t] = input(e, size - 1 - t)[q] - mean;
        square += backward[t] * backward[t];
    }
    if (most > least)
        order = (int)rint({{ memory }} / fmax(median_frequency(backward, size), 1.0 / size));
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
        reflection = -2.0 * both / power;
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
}

/* The next value of an input that was identified. */
static double continued({{ name }}_estimator *e, int q)
{
    double *past = e->past[q], next = 0.0;
    for (int i = 0; i < e->order[q]; i++)
        next -= e->filter[q][i + 1] * past[i];
    memmove(past + 1, past, (e->order[q] - 1) * sizeof(double));
    past[0] = next;
    return e->mean[q] + next;
}

static void predict(const {{ name }}_estimator *e, double *next)
{
    for (int i = 0; i < N; i++) {
        next[i] = offset[i];
        for (int k = 0; k < M; k++)
            next[i] += on_states[i * M + k] * e->x[k];
        for (int k = 0; k < (DELAYS + 1) * Q; k++)
            next[i] += on_inputs[i * (DELAYS + 1) * Q + k] * input(e, DELAYS - k / Q)[k % Q];
    }
}

int {{ name }}_estimate({{ name }}_estimator *e, const double *u, const double *y)
{
    double sample[{{ [Q, 1] | max }}], newest[N];
    int rows[N], count = 0, exact = 1, plain;
    for (int i = 0; i < N; i++) {
        if (isinf(y[i]))
            return 1;
        exact = exact && noise[i] == 0.0;
        if (!isnan(y[i]))
            rows[count++] = i;
    }
    for (int q = 0; q < Q; q++)
        if (isinf(u[q]) || (isnan(u[q]) && e->filled < 4))
            return 1;
    for (int q = 0; q < Q; q++) {
        sample[q] = u[q];
        if (isnan(u[q])) {
            identify(e, q);
            sample[q] = continued(e, q);
        }
    }
    if (e->taken == 0) {
        e->partly = 1;
        for (int i = 0; i < M; i++)
            e->x[i] = centre[i % N];
    }
    exact = exact && count == N;
    plain = exact && e->since == 0 && e->taken >= BEGINS;
    if (!plain) {
        shift(e, e->taken >= BEGINS);
        if (e->taken >= BEGINS)
            limit(e, !(e->partly || count));
        measure(e, rows, count);
    }
    memcpy(newest, centre, sizeof newest);
    if (e->taken >= BEGINS)
        predict(e, newest);
    memmove(e->x, e->x + N, OLD * sizeof(double));
    memcpy(e->x + OLD, newest, sizeof newest);
    for (int i = 0; i < N; i++)
        e->innovation[i] = y[i] - newest[i];
    for (int i = 0; !plain && i < M; i++)
        for (int c = 0; c < count; c++)
            e->x[i] += e->gain[i * N + c] * e->innovation[rows[c]];
    for (int c = 0; c < count; c++)
        if (noise[rows[c]] == 0.0)
            e->x[OLD + rows[c]] = y[rows[c]];
    e->complete = exact ? (e->complete < M ? e->complete + 1 : M) : 0;
    if (e->complete * N > OLD) {
        e->since = e->partly = 0;
        memset(e->covariance, 0, sizeof e->covariance);
    } else if (!plain) {
        e->since += e->since < LEADS;
        e->partly = e->partly || count;
    }
    e->newest = (e->newest + 1) % RECORD;
    memcpy(e->inputs + e->newest * Q, sample, Q * sizeof(double));
    e->filled += e->filled < RECORD;
    e->taken += e->taken < BEGINS;
    return 0;
}

const double *{{ name }}_estimated(const {{ name }}_estimator *e) { return e->x + OLD; }

double {{ name }}_deviation(const {{ name }}_estimator *e, int state)
{
    return sqrt(P(OLD + state, OLD + state));
}

int {{ name }}_forecast({{ name }}_estimator *e, int n, const double *future, double *x)
{
    double next[{{ [Q, 1] | max }}];
    if (e->taken < BEGINS)
        return 1;
    for (int row = 0; row < {{ upper }}_U_ROWS; row++)
        memcpy(e->u_history + row * Q, input(e, {{ upper }}_U_ROWS - row), Q * sizeof(double));
    if ({{ name }}_start(&e->model, e->x, e->u_history))
        return 1;
    for (int q = 0; !future && q < Q; q++)
        identify(e, q);
    for (int step = 0; step < n; step++) {
        const double *u = step ? next : input(e, 0);
        if (step && future)
            u = future + (step - 1) * Q;
        for (int q = 0; step && !future && q < Q; q++)
            next[q] = continued(e, q);
        if ({{ name }}_step(&e->model, u))
            return 2;
        memcpy(x + step * N, e->model.x, sizeof e->model.x);
    }
    return 0;
}

{% from "facts.jinja" import N, Q, s, z, n, m, dt, past, upper, follows, x_rows, u_rows, window, lead_samples with context %}
/* {{ mark }} C header
 *
 * A seakeep model that runs one step at a time: plain C99, no memory but the struct below, no
 * dependency but the C library. Values are in the units of {{ name }}_state_units and
 * {{ name }}_input_units.
 *
 *     {{ name }}_model m;
 *     {{ name }}_start(&m, x_history, u_history);
 *     for (;;) { ... status = {{ name }}_step(&m, u); ... m.x[0] ... }
 *
 * Instant k is that of the last row of x_history. The step from k to k + 1 takes the inputs of
 * instant k + {{ upper }}_LEAD: where the model looks ahead, its time is that much behind its input.
{% if follows %}
 * Inputs are the probes as measured, where they stood in training: a step carries the waves to the
 * vessel by its own surge.
{% endif %}
 */
#ifndef {{ upper }}_H
#define {{ upper }}_H

#ifdef __cplusplus
extern "C" {
#endif

#define {{ upper }}_STATES {{ N }}
#define {{ upper }}_INPUTS {{ Q }}
#define {{ upper }}_LEAD {{ lead_samples }}
#define {{ upper }}_X_ROWS {{ x_rows }} /* of x_history: instants k - {{ x_rows - 1 }} to k */
#define {{ upper }}_U_ROWS {{ u_rows }} /* of u_history: instants k - {{ u_rows - lead_samples }} to k - 1 + {{ upper }}_LEAD */
#define {{ upper }}_STEP {{ dt }} /* s */

#define {{ upper }}_WINDOW {{ window }} /* rows of inputs that a step reads */
#define {{ upper }}_NOW {{ now }} /* of these, that of the instant which it starts from */
#define {{ upper }}_DELAYED {{ n }} /* what these rows become: with input delays */
#define {{ upper }}_DIRECT {{ m }} /* and without */

extern const char *const {{ name }}_state_names[], *const {{ name }}_state_units[];
extern const char *const {{ name }}_input_names[], *const {{ name }}_input_units[];

/* All that a model remembers. To save and restore it, copy it as it is. */
typedef struct {
    double x[{{ N }}]; /* states at this instant */
    double regressors[{{ N * (s + 1) + n * (z + 1) + m }}];
    double inputs[{{ [1, window * Q] | max }}];
    double limit[{{ N }}];
{% if follows %}
    double surge[{{ past }}]; /* newest first */
{% endif %}
    double excess;
} {{ name }}_model;

/* Start from measured states and inputs, oldest row first, one row after the other.
 * Returns 0, or 1 if a value is not finite; the model is not started then. */
int {{ name }}_start({{ name }}_model *m, const double *x_history, const double *u_history);

/* Make one step with one row of inputs. Returns 0; 1 if an input is not finite, and the model is
 * as it was; 2 if the run is lost: a state is ten times as far from its mean as it ever was in
 * training, in proportion to the waves of late. All states are NaN from then on. */
int {{ name }}_step({{ name }}_model *m, const double *u);

/* Derivative of the states after a step with inputs u along a `change` of these, by central
 * differences: exact but for rounding where no square, cube or place of the vessel enters. */
void {{ name }}_derivative(const {{ name }}_model *m, const double *u, const double *change, double *response);

/* What drives the step from an instant, in physical units: of the {{ upper }}_WINDOW rows of inputs
 * around it{{ ", and of the last " ~ past ~ " surges, newest first" if follows }}. */
void {{ name }}_regressors(const double *inputs, const double *surge, double *delayed, double *direct);

#ifdef __cplusplus
}
#endif
#endif

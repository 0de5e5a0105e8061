{% from "facts.jinja" import N, Q, s, z, n, past, upper, x_rows, u_rows, late, fore, lead_samples with context %}
/* {{ mark }} C header of an estimator
 *
 * Follows a vessel sample by sample, beside {{ name }}.c: a Kalman filter on the delayed states
 * fills what was not measured, and lost inputs are predicted. Plain C99, no
 * memory but the struct below. Set it to zero before the first sample:
 *
 *     static {{ name }}_estimator e;
 *     for (;;) {
 *         ... NAN for what is missing ...
 *         status = {{ name }}_estimate(&e, u, y); ... {{ name }}_estimated(&e)[0] ...
 *         status = {{ name }}_forecast(&e, n, NULL, x, NULL); ... x[i * {{ upper }}_STATES] ...
 *     }
 */
#ifndef {{ upper }}_ESTIMATOR_H
#define {{ upper }}_ESTIMATOR_H

#include "{{ name }}.h"

#ifdef __cplusplus
extern "C" {
#endif

enum {
    {{ upper }}_EXTENDED = {{ N * (s + 1) }},
    {{ upper }}_RECORD = {{ record }},
    {{ upper }}_ORDER = {{ (record + fore) // 3 }},
    {{ upper }}_ESTIMATES = {{ late + model.errors.longest + ([s + 1, x_rows, past + z + 1] | max) }}
};

/* What of the waves, of the means of inputs or of surge lies outside the training; or whether waves were lost that
 * estimates and forecasts go back to, beyond gaps of up to {{ gap }} samples, which are closed. While
 * nothing at all is measured they are not: forecasts hold what they do. Consistency says that a state
 * jumped of late, and was taken as lost. */
enum { {{ upper }}_INSIDE = 0, {{ upper }}_PERIOD = 1, {{ upper }}_HEIGHT = 2, {{ upper }}_STEEPNESS = 4, {{ upper }}_SURGE = 8, {{ upper }}_CONSISTENCY = 16, {{ upper }}_LOST = 32, {{ upper }}_MEAN = 64 };

/* All that an estimator remembers. To save and restore it, copy it as it is. */
typedef struct {
    double x[{{ upper }}_ESTIMATES * {{ upper }}_STATES]; /* estimates, oldest row first; the last one is of this instant */
    double covariance[{{ upper }}_EXTENDED * {{ upper }}_EXTENDED]; /* of their errors */
    double innovation[{{ upper }}_STATES]; /* measurement less prediction, NaN without one */
    double inputs[({{ upper }}_RECORD + {{ fore }}) * {{ [Q, 1] | max }}]; /* measured, then predicted */
    double history[{{ upper }}_EXTENDED]; /* estimates that no wave to come moves */
    double delayed[{{ [n, 1] | max * (late + z + 1) }}];
    double surge[{{ upper }}_RECORD];
    unsigned char lost[{{ upper }}_RECORD * {{ [Q, 1] | max }}]; /* whether an input was not measured */
    /* Of the samples that waves to come move: */
    double y[{{ late + 1 }}][{{ upper }}_STATES], gains[{{ late + 1 }}][{{ upper }}_EXTENDED * {{ upper }}_STATES];
    int plain[{{ late + 1 }}], slot, pending, begun;
    int filled, taken, since, partly, complete, unseen, doubtful;
    /* Of inputs and states: the last three that were taken, their ages, and squares of third differences. */
    double last[{{ Q + N }}][3], age[{{ Q + N }}][3], squares[{{ Q + N }}], weight[{{ Q + N }}];
    /* What lies below is work space. */
    double ahead[{{ upper }}_EXTENDED], cross[{{ upper }}_EXTENDED * {{ upper }}_STATES];
    double forward[{{ record + fore }}], backward[{{ record + fore }}];
    double filter[{{ [Q, 1] | max }}][{{ upper }}_ORDER + 1], past[{{ [Q, 1] | max }}][{{ upper }}_ORDER];
    double mean[{{ [Q, 1] | max }}];
    double apart[{{ [Q, 1] | max }}][{{ upper }}_ORDER], innovation_of[{{ [Q, 1] | max }}];
    int order[{{ [Q, 1] | max }}], departs[{{ [Q, 1] | max }}];
    double u_history[{{ [u_rows * Q, 1] | max }}];
    double planned[({{ upper }}_RECORD + {{ fore }}) * {{ [Q, 1] | max }}];
    int is_planned;
    double first[{{ [u_rows * Q, 1] | max }}], first_apart[{{ [u_rows * Q, 1] | max }}];
    {{ name }}_model models[{{ 1 + 2 * waves | length }}];
} {{ name }}_estimator;

/* Take one sample: {{ upper }}_INPUTS inputs and {{ upper }}_STATES states, NaN for what is missing.
 * Returns 0, or 1 if a value is infinite, or an input is missing before the fifth sample; the
 * estimator is as it was then. */
int {{ name }}_estimate({{ name }}_estimator *e, const double *u, const double *y);

/* Estimates of the states at the last sample. */
const double *{{ name }}_estimated(const {{ name }}_estimator *e);

/* Standard deviation of the error of one of them. */
double {{ name }}_deviation(const {{ name }}_estimator *e, int state);

/* What lies outside the training in the record that is kept; a sum of the names above. It takes the
 * record's length squared: ask now and then. */
int {{ name }}_validity({{ name }}_estimator *e);

/* Forecast n instants after the last sample into x, a row for each. `future` holds the inputs of
 * the n - 1 + {{ upper }}_LEAD instants after it, or is NULL. Waves that are NaN there are
 * predicted from the samples up to now, and from the first rows in which all waves are given;
 * other inputs stay at their last value. Where the standard deviation of the errors comes near
 * that of the training, x tends to the mean there. `std` takes these deviations, as x, or is NULL;
 * they are those in data like the training.
 * Returns 0; 1 if there are fewer than {{ model.history_samples }} samples; 2 if a run is lost, as a step is. */
int {{ name }}_forecast({{ name }}_estimator *e, int n, const double *future, double *x, double *std);

#ifdef __cplusplus
}
#endif
#endif

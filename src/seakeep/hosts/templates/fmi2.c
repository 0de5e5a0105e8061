{% set upper = name | upper %}
/* {{ mark }} FMI 2.0 co-simulation around {{ name }}.c
 *
 * Types and functions are those of the FMI standard 2.0, sections 2.1 and 4.2.
 */
#include "{{ name }}{{ "_estimator" if ahead else "" }}.h"

#include <math.h>
#include <stddef.h>
#include <string.h>

#if defined _WIN32
#define EXPORT __declspec(dllexport)
#elif defined __GNUC__
#define EXPORT __attribute__((visibility("default")))
#else
#define EXPORT
#endif
#ifdef FMI2_FUNCTION_PREFIX /* where sources are linked into a program */
#define PASTE(a, b) a##b
#define PREFIXED(a, b) PASTE(a, b)
#define FMI(name) PREFIXED(FMI2_FUNCTION_PREFIX, name)
#else
#define FMI(name) name
#endif
#define GUID "{{ guid }}"

typedef enum { OK, WARNING, DISCARD, ERROR, FATAL, PENDING } Status;
typedef const char *String;
typedef unsigned int Reference;
typedef struct {
    void (*logger)(void *, String, Status, String, String, ...);
    void *(*allocate)(size_t, size_t);
    void (*release)(void *);
    void (*step_finished)(void *, Status);
    void *environment;
} Callbacks;

enum {
    N = {{ upper }}_STATES,
    Q = {{ upper }}_INPUTS,
{% if ahead %}
    OUTPUTS = Q + N, /* values are inputs and what was measured, estimates, forecasts, and their errors */
    VALIDITY = OUTPUTS + N * {{ 1 + 2 * ahead }},
    X_HISTORY, /* there are no histories */
    U_HISTORY = X_HISTORY,
    COUNT = U_HISTORY
{% else %}
    OUTPUTS = Q, /* values are inputs, outputs, and the histories to start from */
    X_HISTORY = OUTPUTS + N,
    U_HISTORY = X_HISTORY + {{ upper }}_X_ROWS * N,
    COUNT = U_HISTORY + {{ upper }}_U_ROWS * Q
{% endif %}
};

typedef struct {
    char guid[sizeof GUID];
    int started;
    double next; /* where the next step begins, s; NaN where it may begin anywhere */
    double values[COUNT];
    {{ name }}_{{ "estimator" if ahead else "model" }} model;
} State;

typedef struct {
    State state;
    const Callbacks *callbacks;
    char *name;
} Instance;

static const double start_values[X_HISTORY] = {
{{ channels | map(attribute="start") | list | numbers }}
};

static Status report(Instance *instance, Status status, const char *message)
{
    instance->callbacks->logger(instance->callbacks->environment, instance->name, status,
                                status == ERROR ? "logStatusError" : "logStatusDiscard", message);
    return status;
}

static void reset(State *state)
{
    memset(state, 0, sizeof *state);
    memcpy(state->guid, GUID, sizeof GUID);
    state->next = NAN;
    memcpy(state->values, start_values, sizeof start_values);
    for (int i = X_HISTORY; i < U_HISTORY; i++)
        state->values[i] = start_values[OUTPUTS + (i - X_HISTORY) % N];
    for (int i = U_HISTORY; i < COUNT; i++)
        state->values[i] = start_values[(i - U_HISTORY) % (Q > 0 ? Q : 1)];
}

EXPORT String FMI(fmi2GetTypesPlatform)(void) { return "default"; }
EXPORT String FMI(fmi2GetVersion)(void) { return "2.0"; }

EXPORT Status FMI(fmi2SetDebugLogging)(void *c, int on, size_t count, const String names[])
{
    return OK;
}

EXPORT void *FMI(fmi2Instantiate)(String name, int type, String guid, String resources,
                                  const Callbacks *callbacks, int visible, int logging)
{
    Instance *made;
    if (!callbacks || !callbacks->logger || !callbacks->allocate || !callbacks->release || !name)
        return NULL;
    if (type != 1 || !guid || strcmp(guid, GUID) != 0) {
        callbacks->logger(callbacks->environment, name, ERROR, "logStatusError",
                          "this is a co-simulation FMU with the GUID " GUID);
        return NULL;
    }
    made = callbacks->allocate(1, sizeof *made);
    if (!made)
        return NULL;
    made->callbacks = callbacks;
    made->name = callbacks->allocate(strlen(name) + 1, 1);
    if (!made->name) {
        callbacks->release(made);
        return NULL;
    }
    strcpy(made->name, name);
    reset(&made->state);
    return made;
}

EXPORT void FMI(fmi2FreeInstance)(void *c)
{
    Instance *instance = c;
    if (!instance)
        return;
    instance->callbacks->release(instance->name);
    instance->callbacks->release(instance);
}

EXPORT Status FMI(fmi2SetupExperiment)(void *c, int has_tolerance, double tolerance, double start,
                                       int has_stop, double stop)
{
    return OK;
}

EXPORT Status FMI(fmi2EnterInitializationMode)(void *c) { return OK; }

EXPORT Status FMI(fmi2ExitInitializationMode)(void *c)
{
    Instance *instance = c;
{% if not ahead %}
    double *values = instance->state.values;
    if ({{ name }}_start(&instance->state.model, values + X_HISTORY, values + U_HISTORY))
        return report(instance, ERROR, "a start value of a history is not finite");
{% endif %}
    instance->state.started = 1;
    return OK;
}

EXPORT Status FMI(fmi2Terminate)(void *c) { return OK; }

EXPORT Status FMI(fmi2Reset)(void *c)
{
    reset(&((Instance *)c)->state);
    return OK;
}

EXPORT Status FMI(fmi2GetReal)(void *c, const Reference at[], size_t count, double values[])
{
    Instance *instance = c;
    for (size_t i = 0; i < count; i++) {
        if (at[i] >= COUNT)
            return report(instance, ERROR, "there is no variable with this value reference");
        values[i] = instance->state.values[at[i]];
{% if ahead %}
        if (at[i] == VALIDITY) /* found when asked for: it takes long */
            values[i] = {{ name }}_validity(&instance->state.model);
{% endif %}
    }
    return OK;
}

EXPORT Status FMI(fmi2SetReal)(void *c, const Reference at[], size_t count, const double values[])
{
    Instance *instance = c;
    State *state = &instance->state;
    for (size_t i = 0; i < count; i++) {
        int place = at[i] < COUNT ? (int)at[i] : OUTPUTS;
        if (place >= OUTPUTS && place < X_HISTORY)
            return report(instance, ERROR, "there is no variable to set with this value reference");
        if (place >= X_HISTORY && state->started)
            return report(instance, ERROR, "histories are set before the end of initialization");
        state->values[place] = values[i];
    }
{% if not ahead %}
    if (!state->started)
        memcpy(state->values + OUTPUTS, state->values + U_HISTORY - N, N * sizeof(double));
{% endif %}
    return OK;
}

/* There are no variables of other types. */
{% for type, c in (("Integer", "int"), ("Boolean", "int"), ("String", "String")) %}
EXPORT Status FMI(fmi2Get{{ type }})(void *c, const Reference at[], size_t count, {{ c }} values[])
{
    return count ? ERROR : OK;
}
EXPORT Status FMI(fmi2Set{{ type }})(void *c, const Reference at[], size_t count, const {{ c }} values[])
{
    return count ? ERROR : OK;
}
{% endfor %}

EXPORT Status FMI(fmi2GetFMUstate)(void *c, void **saved)
{
    Instance *instance = c;
    if (!*saved)
        *saved = instance->callbacks->allocate(1, sizeof(State));
    if (!*saved)
        return report(instance, ERROR, "there is no memory for the state");
    memcpy(*saved, &instance->state, sizeof(State));
    return OK;
}

EXPORT Status FMI(fmi2SetFMUstate)(void *c, void *saved)
{
    State *state = &((Instance *)c)->state;
    memcpy(state, saved, sizeof(State));
    state->next = NAN;
    return OK;
}

EXPORT Status FMI(fmi2FreeFMUstate)(void *c, void **saved)
{
    if (*saved)
        ((Instance *)c)->callbacks->release(*saved);
    *saved = NULL;
    return OK;
}

EXPORT Status FMI(fmi2SerializedFMUstateSize)(void *c, void *saved, size_t *size)
{
    *size = sizeof(State);
    return OK;
}

EXPORT Status FMI(fmi2SerializeFMUstate)(void *c, void *saved, char bytes[], size_t size)
{
    if (size < sizeof(State))
        return report(c, ERROR, "the room for the serialized state is too small");
    memcpy(bytes, saved, sizeof(State));
    return OK;
}

EXPORT Status FMI(fmi2DeSerializeFMUstate)(void *c, const char bytes[], size_t size, void **saved)
{
    Instance *instance = c;
    if (size != sizeof(State) || memcmp(bytes, GUID, sizeof GUID) != 0)
        return report(instance, ERROR, "this is no state of this FMU");
    if (!*saved)
        *saved = instance->callbacks->allocate(1, sizeof(State));
    if (!*saved)
        return report(instance, ERROR, "there is no memory for the state");
    memcpy(*saved, bytes, sizeof(State));
    return OK;
}

/* Of the outputs after the next step, along a change of the inputs that it takes. */
EXPORT Status FMI(fmi2GetDirectionalDerivative)(void *c, const Reference unknown[], size_t unknowns,
                                                const Reference known[], size_t knowns,
                                                const double change[], double response[])
{
{% if ahead %}
    return ERROR;
{% else %}
    Instance *instance = c;
    double along[Q + 1] = { 0.0 }, slope[N];
    for (size_t i = 0; i < knowns; i++) {
        if (known[i] >= Q)
            return report(instance, ERROR, "derivatives are those with respect to inputs");
        along[known[i]] = change[i];
    }
    {{ name }}_derivative(&instance->state.model, instance->state.values, along, slope);
    for (size_t i = 0; i < unknowns; i++) {
        if (unknown[i] < OUTPUTS || unknown[i] >= X_HISTORY)
            return report(instance, ERROR, "derivatives are those of outputs");
        response[i] = slope[unknown[i] - OUTPUTS];
    }
    return OK;
{% endif %}
}

EXPORT Status FMI(fmi2SetRealInputDerivatives)(void *c, const Reference at[], size_t count,
                                               const int order[], const double values[])
{
    return ERROR;
}

EXPORT Status FMI(fmi2GetRealOutputDerivatives)(void *c, const Reference at[], size_t count,
                                                const int order[], double values[])
{
    return ERROR;
}

EXPORT Status FMI(fmi2DoStep)(void *c, double time, double step, int no_return)
{
    Instance *instance = c;
    State *state = &instance->state;
    int status;
    if (!(fabs(step - {{ upper }}_STEP) <= 1e-6 * {{ upper }}_STEP))
        return report(instance, ERROR, "the communication step must be {{ dt }} s");
    if (fabs(time - state->next) > 0.01 * {{ upper }}_STEP)
        return report(instance, ERROR, "a step must begin where the last one ended");
{% if ahead %}
    double *values = state->values, *coming = values + OUTPUTS + N;
    if ({{ name }}_estimate(&state->model, values, values + Q))
        return report(instance, DISCARD, "a value is infinite, or an input missing too early");
    memcpy(values + OUTPUTS, {{ name }}_estimated(&state->model), N * sizeof(double));
    status = {{ name }}_forecast(&state->model, {{ ahead }}, NULL, coming, coming + {{ ahead }} * N);
    for (int i = 0; status == 1 && i < {{ 2 * ahead }} * N; i++)
        coming[i] = NAN; /* there is too little history yet */
{% else %}
    status = {{ name }}_step(&state->model, state->values);
    if (status == 1)
        return report(instance, DISCARD, "an input is not finite; the step was not made");
    memcpy(state->values + OUTPUTS, state->model.x, sizeof state->model.x);
{% endif %}
    if (status == 2)
        return report(instance, ERROR, "the run is lost: a state is far beyond its training");
    state->next = time + step;
    return OK;
}

EXPORT Status FMI(fmi2CancelStep)(void *c) { return ERROR; }

/* All steps end before fmi2DoStep does. */
{% for type, c in (("", "Status"), ("Real", "double"), ("Integer", "int"), ("Boolean", "int"), ("String", "String")) %}
EXPORT Status FMI(fmi2Get{{ type }}Status)(void *c, int kind, {{ c }} *value) { return DISCARD; }
{% endfor %}

"""Settings with other values, which are not checked again."""


def altered(table, **values):
    return table.model_copy(update=values)

[[head]]

#include <math.h>

#include "[[prefix]].h"
{% for part in parts if part %}

[[part]]
{% endfor %}

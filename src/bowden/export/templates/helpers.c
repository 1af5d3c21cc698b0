static inline double min(const double a, const double b)
{
    return b < a ? b : a;
}


static inline double max(const double a, const double b)
{
    return b > a ? b : a;
}


static inline int64_t min_int(const int64_t a, const int64_t b)
{
    return b < a ? b : a;
}


static inline int64_t max_int(const int64_t a, const int64_t b)
{
    return b > a ? b : a;
}


/* the newest first, and what was there one place on */
static inline ROW ROW_shifted(ITEM newest, const ROW *past)
{
    ROW moved;

    moved.at[0] = newest;
    for (int i = 1; i < LENGTH; ++i) {
        moved.at[i] = past->at[i - 1];
    }
    return moved;
}

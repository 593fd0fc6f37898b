/* A program with functions of the names that the library keeps to itself. */
int shared_sees(float x);
int rt_occluded(void);
int rt_occluded(void) { return 7; }

int main(void)
{
    return shared_sees(0.5f) == 1 && shared_sees(1.5f) == 0 && rt_occluded() == 7 ? 0 : 1;
}

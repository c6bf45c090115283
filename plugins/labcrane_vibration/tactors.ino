// Tactors for labcrane: motor drivers on PWM pins, told by lines of text over USB.
// "V 17 128 0" sets tactor 1 to half and tactor 2 to rest; the answer is "E 17 MICROSECONDS COUNT".
// All stop when no line has come for 200 ms: a cable that is pulled or a program that dies.

const int PINS[] = {3, 5, 6, 9};
const int COUNT = sizeof(PINS) / sizeof(PINS[0]);
const unsigned long SILENCE_MS = 200;
const int LONGEST = 48;

char line[LONGEST];
int length = 0;
unsigned long last = 0;

void rest() {
  for (int i = 0; i < COUNT; i++) analogWrite(PINS[i], 0);
}

void obey() {
  char *at = line;
  if (*at++ != 'V') return;
  long number = strtol(at, &at, 10), levels[COUNT];
  for (int i = 0; i < COUNT; i++) {
    levels[i] = strtol(at, &at, 10);  // 0 where none is given
    if (levels[i] < 0 || levels[i] > 255) return;  // misread: no answer
  }
  for (int i = 0; i < COUNT; i++) analogWrite(PINS[i], (int)levels[i]);
  last = millis();
  Serial.print("E ");
  Serial.print(number);
  Serial.print(" ");
  Serial.print(micros());
  Serial.print(" ");
  Serial.println(COUNT);
}

void setup() {
  for (int i = 0; i < COUNT; i++) pinMode(PINS[i], OUTPUT);
  rest();
  Serial.begin(115200);
}

void loop() {
  if (millis() - last > SILENCE_MS) rest();
  while (Serial.available() > 0) {
    char sign = (char)Serial.read();
    if (sign == '\n') {
      line[length] = '\0';
      obey();
      length = 0;
    } else if (length < LONGEST - 1) {
      line[length++] = sign;
    }
  }
}
